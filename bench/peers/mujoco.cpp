// MuJoCo as a peer: the Model as MJCF, couplings as joint equalities. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <tinyxml2.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>

#include "peer.h"

namespace lockstep::peers {
namespace {

using tinyxml2::XMLElement;

struct Options {
  const char* integrator = "Euler";
  const char* solver = "Newton";
  const char* jacobian = "dense";
  int iterations = 100;
  // Of equalities. Firm: a time constant of two steps, the least that is stable by itself, instead of 0.02 s. Stiff:
  // also an impedance that corrects nearly all of the error, instead of 0.9 to 0.95.
  enum { soft, firm, stiff } stiffness = soft;
};

std::string numbers(const auto&... values) {
  std::string text;
  (text.append(fmt::format("{:.17g} ", double(values))), ...);
  return text;
}
std::string vector(const Eigen::Vector3d& v) { return numbers(v.x(), v.y(), v.z()); }

using Attributes = std::vector<std::pair<const char*, std::string>>;

XMLElement& append(XMLElement& parent, const char* name, const Attributes& attributes) {
  XMLElement& child = *parent.InsertNewChildElement(name);
  for (const auto& [key, value] : attributes) child.SetAttribute(key, value.c_str());
  return child;
}

Attributes placed(const std::string& link, const Pose& pose) {
  const Eigen::Quaterniond turn(pose.linear());
  return {
      {"name", link}, {"pos", vector(pose.translation())}, {"quat", numbers(turn.w(), turn.x(), turn.y(), turn.z())}};
}

void append_inertia(XMLElement& body, const Inertia& inertia) {
  if (inertia.mass == 0.0) return;  // a link that is fixed to another
  const Eigen::Matrix3d& i = inertia.about_center;
  append(body, "inertial",
         {{"pos", vector(inertia.center)},
          {"mass", numbers(inertia.mass)},
          {"fullinertia", numbers(i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2))}});
}

void append_children(const Model& model, const std::string& link, XMLElement& parent) {
  for (const Joint& joint : model.joints) {
    if (joint.parent != link) continue;
    XMLElement& body = append(parent, "body", placed(joint.child, joint.origin));
    append_inertia(body, model.links[model.link_index(joint.child)].inertia);
    // A servo's velocity target is zero, so its kd is damping. MuJoCo's Euler method takes damping implicitly.
    if (joint.moves())
      append(body, "joint",
             {{"name", joint.name},
              {"type", joint.kind == JointKind::prismatic ? "slide" : "hinge"},
              {"axis", vector(joint.axis)},
              {"damping", numbers(joint.damping + joint.drive.kd)}});
    append_children(model, joint.child, body);
  }
}

void append_couplings(const Model& model, double dt, const Options& options, XMLElement& root) {
  XMLElement& equality = append(root, "equality", {});
  for (const Coupling& coupling : model.couplings) {
    const CouplingTerm& other = coupling.terms[0];
    XMLElement& joint = append(equality, "joint",
                               {{"joint1", coupling.joint},
                                {"joint2", other.joint},
                                {"polycoef", numbers(-coupling.offset, -other.ratio, 0, 0, 0)}});
    if (options.stiffness != Options::soft) joint.SetAttribute("solref", numbers(2 * dt, 1).c_str());
    if (options.stiffness == Options::stiff) joint.SetAttribute("solimp", "0.9999 0.9999 0.001");
  }
}

void write_mjcf(const Model& model, double dt, const Options& options, const std::filesystem::path& path) {
  tinyxml2::XMLDocument document;
  XMLElement& root = *document.NewElement("mujoco");
  document.InsertEndChild(&root);
  append(root, "compiler", {{"angle", "radian"}});
  append(root, "option",
         {{"timestep", numbers(dt)},
          {"gravity", vector(model.gravity)},
          {"integrator", options.integrator},
          {"solver", options.solver},
          {"jacobian", options.jacobian},
          {"iterations", fmt::format("{}", options.iterations)}});
  // Memory for the couplings and no more: MuJoCo would clear what is unused, and that would take space in the cache.
  append(root, "size", {{"njmax", fmt::format("{}", model.couplings.size())}, {"nconmax", "1"}, {"nstack", "200000"}});
  XMLElement& base = append(append(root, "worldbody", {}), "body", placed(model.links[0].name, root_of(model).pose));
  if (root_of(model).floating) {
    append_inertia(base, model.links[0].inertia);
    append(base, "freejoint", {});
  }
  append_children(model, model.links[0].name, base);
  append_couplings(model, dt, options, root);
  XMLElement& actuators = append(root, "actuator", {});
  for (const Joint& joint : model.joints)
    if (joint.drive.kp > 0)
      append(actuators, "position", {{"name", joint.name}, {"joint", joint.name}, {"kp", numbers(joint.drive.kp)}});
  document.SaveFile(path.c_str());
}

mjModel* load(const Model& model, double dt, const Options& options) {
  const auto path = std::filesystem::temp_directory_path() / fmt::format("lockstep-peer-{}.xml", getpid());
  write_mjcf(model, dt, options, path);
  char error[1000] = "";
  mjModel* loaded = mj_loadXML(path.c_str(), nullptr, error, sizeof error);
  std::filesystem::remove(path);
  if (!loaded) throw std::runtime_error(std::string("MuJoCo: ") + error);
  return loaded;
}

class MujocoPeer : public Peer {
 public:
  MujocoPeer(const Model& model, double dt, int environments, const Options& options)
      : source_(model), model_(load(model, dt, options), mj_deleteModel) {
    mju_user_warning = [](const char*) {};  // writes no log file; failed() looks at the warnings
    model_->opt.disableflags |= mjDSBL_CONTACT | mjDSBL_LIMIT | mjDSBL_FRICTIONLOSS;
    for (int e = 0; e < environments; ++e) data_.emplace_back(mj_makeData(model_.get()), mj_deleteData);
    for (const Joint& joint : model.joints) {
      if (!joint.moves()) continue;
      start_.push_back({joint.position, joint.velocity});
      const int id = mj_name2id(model_.get(), mjOBJ_JOINT, joint.name.c_str());
      position_.push_back(model_->jnt_qposadr[id]);
      velocity_.push_back(model_->jnt_dofadr[id]);
      actuator_.push_back(mj_name2id(model_.get(), mjOBJ_ACTUATOR, joint.name.c_str()));
    }
    MujocoPeer::reset();
  }

  void reset() override {
    for (auto& data : data_) {
      mj_resetData(model_.get(), data.get());
      for (std::size_t dof = 0; dof < start_.size(); ++dof) {
        data->qpos[position_[dof]] = start_[dof].first;
        data->qvel[velocity_[dof]] = start_[dof].second;
      }
    }
  }
  void set_targets(const Eigen::VectorXd& targets) override {
    for (auto& data : data_)
      for (std::size_t j = 0; j < actuator_.size(); ++j)
        if (actuator_[j] >= 0) data->ctrl[actuator_[j]] = targets[static_cast<Eigen::Index>(j)];
  }
  void step() override {
    for (auto& data : data_) mj_step(model_.get(), data.get());
  }
  Eigen::VectorXd positions() const override {
    Eigen::VectorXd q(position_.size());
    for (std::size_t j = 0; j < position_.size(); ++j) q[j] = data_[0]->qpos[position_[j]];
    return q;
  }
  std::optional<reference::State> state() const override {
    const mjData& data = *data_[0];
    reference::State state = reference::Mechanism(source_).initial_state();
    state.q = positions();
    for (std::size_t j = 0; j < velocity_.size(); ++j)
      state.v[state.v.size() - state.q.size() + static_cast<Eigen::Index>(j)] = data.qvel[velocity_[j]];
    if (!root_of(source_).floating) return state;
    // The free joint comes first: linear velocity in world axes, angular velocity in body axes.
    reference::RootPose& root = state.roots[0];
    root.position = Eigen::Map<const Eigen::Vector3d>(data.qpos);
    root.orientation = Eigen::Quaterniond(data.qpos[3], data.qpos[4], data.qpos[5], data.qpos[6]);
    state.v.head<3>() = Eigen::Map<const Eigen::Vector3d>(data.qvel + 3);
    state.v.segment<3>(3) =
        root.orientation.conjugate() * Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(data.qvel));
    return state;
  }
  bool failed() const override {
    for (const int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (data_[0]->warning[warning].number > 0) return true;
    return false;
  }

 private:
  Model source_;
  std::unique_ptr<mjModel, void (*)(mjModel*)> model_;
  std::vector<std::unique_ptr<mjData, void (*)(mjData*)>> data_;
  std::vector<std::pair<double, double>> start_;  // by dof: position, velocity
  std::vector<int> position_, velocity_, actuator_;
};

}  // namespace

std::vector<Contender> mujoco_contenders() {
  const std::pair<const char*, Options> choices[] = {
    {"default", {}},
    {"Euler, Newton once, dense", {.iterations = 1}},
    {"Euler, Newton, sparse", {.jacobian = "sparse"}},
    {"Euler, CG, dense", {.solver = "CG"}},
    {"Euler, PGS, dense", {.solver = "PGS"}},
    {"implicit, Newton, dense", {.integrator = "implicit"}},
#if mjVERSION_HEADER >= 235
    {"implicitfast, Newton, dense", {.integrator = "implicitfast"}},
#endif
    {"firm: Euler, Newton once, dense", {.iterations = 1, .stiffness = Options::firm}},
    {"stiff: Euler, Newton once, dense", {.iterations = 1, .stiffness = Options::stiff}},
    {"stiff: Euler, PGS, dense", {.solver = "PGS", .stiffness = Options::stiff}},
    {"stiff: implicit, Newton once, dense", {.integrator = "implicit", .iterations = 1, .stiffness = Options::stiff}},
    {"stiff: RK4, Newton once, dense", {.integrator = "RK4", .iterations = 1, .stiffness = Options::stiff}},
  };
  std::vector<Contender> all;
  for (const auto& [words, options] : choices)
    all.push_back({.engine = fmt::format("MuJoCo {}", mj_versionString()),
                   .settings = words,
                   .exact = options.stiffness == Options::stiff,
                   .make = [options = options](const Model& model, double dt, int environments) {
                     return std::make_unique<MujocoPeer>(model, dt, environments, options);
                   }});
  return all;
}

}  // namespace lockstep::peers
