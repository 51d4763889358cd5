// Models of our own against what MuJoCo makes of them: facts.mjs wrote the facts. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "model/tendons.h"
#include "model/trees.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

using nlohmann::json;
using std::string;
using Efforts = std::map<string, double>;

const std::filesystem::path folder = LOCKSTEP_MJCF;

string name_of(const json& fact) {
  const string name = fact["name"], body = fact["body"];
  return !name.empty() ? name : body.empty() ? "body" : body;
}

json facts_of(const string& name) {
  std::ifstream stream(folder / "facts" / (name + ".json"));
  return json::parse(stream);
}

class MjcfFacts : public testing::TestWithParam<string> {
 protected:
  void SetUp() override {
    facts = facts_of(GetParam());
    const string path = folder / "models" / (GetParam() + ".xml");
    std::ifstream text(path);
    const bool has_key = string(std::istreambuf_iterator<char>(text), {}).find("<key ") != string::npos;
    import = import_mjcf_file(path, {.keyframe = has_key ? "0" : ""});
  }
  const Model& model() const { return import.model; }
  // Hinges and slides that no equality holds, by name.
  bool is_here(const json& fact) const { return fact["type"] != "free" && joint(model(), name_of(fact)).moves(); }

  json facts;
  Import import;
};

TEST_P(MjcfFacts, hold_for_each_joint) {
  for (const json& fact : facts["joints"]) {
    if (!is_here(fact)) continue;
    const Joint& own = joint(model(), name_of(fact));
    SCOPED_TRACE(own.name);
    const bool takes_tendons = std::any_of(import.report.begin(), import.report.end(), [&](const string& line) {
      return line.find("on the joint that moves them") != string::npos && line.find("on " + own.name) != string::npos;
    });
    EXPECT_NEAR(own.armature, fact["armature"].get<double>(), takes_tendons ? infinity : 1e-12);
    EXPECT_NEAR(own.friction, fact["friction"].get<double>(), takes_tendons ? infinity : 1e-12);
    if (fact["range"].is_null()) {
      EXPECT_TRUE((own.lower == -infinity && own.upper == infinity) || takes_tendons);
    } else {
      if (fact["range"][0].is_null())
        EXPECT_EQ(own.lower, -infinity);
      else
        EXPECT_NEAR(own.lower, fact["range"][0].get<double>(), 1e-12);
      EXPECT_NEAR(own.upper, fact["range"][1].get<double>(), 1e-12);
    }
  }
}

struct Path {
  double length, rate_of_roots;
  Efforts ratios;  // how the length changes with each joint
};

Path path_of(const Model& model, const Joint& tendon, const Efforts& q) {
  const Trees trees(model);
  Configuration at = start_of(model, trees);
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    if (const auto found = q.find(model.joints[j].name); found != q.end()) at.position[j] = found->second;
  const Eigen::RowVectorXd jacobian = length_jacobian(model, trees, at, tendon);
  Path path{length_of(model, trees, at, tendon), 0.0, {}};
  const auto joints = static_cast<Eigen::Index>(model.joints.size());
  for (Eigen::Index j = 0; j < joints; ++j)
    if (jacobian[j] != 0.0) path.ratios[model.joints[static_cast<std::size_t>(j)].name] = jacobian[j];
  for (int tree = 0; tree < trees.count(); ++tree)
    for (int half = 0; half < 2; ++half)
      path.rate_of_roots += jacobian.segment<3>(joints + 6 * tree + 3 * half) *
                            (trees.roots[static_cast<std::size_t>(tree)].pose.linear() *
                             trees.roots[static_cast<std::size_t>(tree)].velocity.segment<3>(3 * half));
  return path;
}

// Tendons have the numbers that their couplings and paths give them.
void place_tendons(const Model& model, Efforts& q, Efforts& v) {
  for (const Joint& tendon : model.joints) {
    if (!is_spatial(tendon)) continue;
    const Path path = path_of(model, tendon, q);
    double& rate = v[tendon.name] = path.rate_of_roots;
    for (const auto& [name, ratio] : path.ratios) rate += ratio * v.at(name);
    q[tendon.name] = path.length;
  }
  for (const Coupling& coupling : model.couplings) {
    if (joint(model, coupling.joint).kind != JointKind::tendon) continue;
    double &length = q[coupling.joint] = -coupling.offset, &rate = v[coupling.joint] = 0.0;
    for (const CouplingTerm& term : coupling.terms)
      length -= term.ratio * q.at(term.joint), rate -= term.ratio * v.at(term.joint);
  }
}

// f(x) of a polynomial, and its slope.
std::pair<double, double> value_of(const Function& function, double x) {
  double value = 0.0, slope = 0.0, power = 1.0;
  const std::vector<double>& c = std::get<Polynomial>(function).coefficients;
  for (std::size_t k = 0; k < c.size(); ++k) {
    value += c[k] * power;
    if (k + 1 < c.size()) slope += static_cast<double>(k + 1) * c[k + 1] * power;
    power *= x;
  }
  return {value, slope};
}

// What multiplies the velocities of a coupling's leaders at q.
double ratio_of(const Coupling& coupling, const CouplingTerm& term, const Efforts& q) {
  return coupling.function ? -value_of(*coupling.function, q.at(term.joint)).second : term.ratio;
}

// Effort of what acts on joints alone or along soft couplings.
Efforts efforts(const Model& model, const Efforts& q, const Efforts& v) {
  Efforts sums;
  for (const Joint& own : model.joints) {
    if (!own.moves()) continue;
    const double drive = own.drive.kp * (own.drive.position_target - q.at(own.name)) +
                         own.drive.kd * (own.drive.velocity_target - v.at(own.name)) + own.effort;
    sums[own.name] = std::clamp(drive, -own.effort_limit, own.effort_limit) -
                     own.stiffness * (q.at(own.name) - own.rest) - own.damping * v.at(own.name);
    if (const auto* spring = std::get_if<Spring>(&own.limit_softness))
      sums[own.name] -= spring->kp * (q.at(own.name) - std::clamp(q.at(own.name), own.lower, own.upper));
  }
  for (const Coupling& coupling : model.couplings) {
    const auto* spring = std::get_if<Spring>(&coupling.softness);
    if (!spring) continue;
    double error = q.at(coupling.joint) + coupling.offset, rate = v.at(coupling.joint);
    for (const CouplingTerm& term : coupling.terms)
      error += term.ratio * q.at(term.joint), rate += term.ratio * v.at(term.joint);
    const double force = -spring->kp * error - spring->kd * rate;
    sums[coupling.joint] += force;
    for (const CouplingTerm& term : coupling.terms) sums[term.joint] += term.ratio * force;
  }
  return sums;
}

// Of the leaders: what followers of hard couplings pass on to them.
Efforts passed_on(Efforts sums, const Model& model, const Efforts& q) {
  for (const Joint& tendon : model.joints) {
    if (!is_spatial(tendon)) continue;
    const double effort = std::exchange(sums[tendon.name], 0.0);
    for (const auto& [name, ratio] : path_of(model, tendon, q).ratios) sums[name] += ratio * effort;
  }
  for (std::size_t pass = 0; pass < model.couplings.size(); ++pass)
    for (const Coupling& coupling : model.couplings) {
      if (!is_hard(coupling.softness)) continue;
      const double effort = std::exchange(sums[coupling.joint], 0.0);
      for (const CouplingTerm& term : coupling.terms) sums[term.joint] -= ratio_of(coupling, term, q) * effort;
    }
  return sums;
}

TEST_P(MjcfFacts, hold_for_inertia_energy_and_efforts) {
  Model open = model();
  open.loops.clear();  // they do not close together
  const Plan plan = compile(open, {.ignore = {.position_limits = true}});
  Batch<double> batch(plan, 1);
  Efforts q, v, theirs;
  for (const json& fact : facts["joints"]) {
    if (!is_here(fact)) continue;
    const string name = name_of(fact);
    q[name] = batch.positions()(plan.dof(name), 0) = fact["position"];
    v[name] = fact["velocity"];
    theirs[name] = fact["effort"];
  }
  place_tendons(model(), q, v);
  for (const json& fact : facts.value("tendons", json::array())) {
    const string name = fact["name"];
    if (std::none_of(model().joints.begin(), model().joints.end(), [&](const Joint& j) { return j.name == name; }))
      continue;  // it has nothing to act by
    EXPECT_NEAR(q.at(name), fact["length"].get<double>(), 1e-12) << name;
    EXPECT_NEAR(v.at(name), fact["rate"].get<double>(), 1e-12) << name;
  }
  for (const auto& [name, position] : q) theirs.try_emplace(name, 0.0);
  const Efforts own = passed_on(efforts(model(), q, v), model(), q), wanted = passed_on(theirs, model(), q);
  for (const auto& [name, effort] : own) EXPECT_NEAR(effort, wanted.at(name), 1e-9 * (1.0 + std::abs(effort))) << name;

  // The energy, but for what has no link: it stands still.
  EXPECT_NEAR(batch.potential_energies()(0, 0), facts["energy"].get<double>(), 1e-9);
  double mass = 0.0;
  for (const Link& link : model().links) mass += link.inertia.mass;
  EXPECT_NEAR(mass, facts["mass"].get<double>(), 1e-12);

  batch.root_velocities().setZero();
  // Twice the kinetic energy of each independent joint that moves with unit velocity, its followers with it.
  const json& matrix = facts["mass_matrix"];
  for (const int independent : plan.independent_dofs()) {
    Efforts motion;
    for (const auto& [name, velocity] : v) motion[name] = plan.dof(name) == independent ? 1.0 : 0.0;
    for (std::size_t pass = 0; pass < model().couplings.size(); ++pass)
      for (const Coupling& coupling : model().couplings) {
        if (!is_hard(coupling.softness)) continue;
        double follower = 0.0;
        for (const CouplingTerm& term : coupling.terms) follower -= ratio_of(coupling, term, q) * motion.at(term.joint);
        motion.at(coupling.joint) = follower;
      }
    std::vector<double> unit(matrix.size());
    for (const json& fact : facts["joints"])
      if (is_here(fact)) unit[fact["dof"].get<std::size_t>()] = motion.at(name_of(fact));
    for (const auto& [name, velocity] : motion) batch.velocities()(plan.dof(name), 0) = velocity;
    double twice = 0.0;
    for (std::size_t i = 0; i < unit.size(); ++i)
      for (std::size_t j = 0; j < unit.size(); ++j) twice += unit[i] * unit[j] * matrix[i][j].get<double>();
    // MuJoCo finds principal axes to about 1e-12 kg m^2.
    EXPECT_NEAR(2.0 * batch.kinetic_energies()(0, 0), twice, 1e-9 * twice + 1e-11)
        << plan.dof_names()[static_cast<std::size_t>(independent)];
  }
}

// By link: its pose in the world where the joints are at q.
std::vector<Eigen::Isometry3d> link_poses(const Model& model, const Efforts& q) {
  const Trees trees(model);
  std::vector<Eigen::Isometry3d> poses(model.links.size());
  for (std::size_t tree = 0; tree < trees.roots.size(); ++tree)
    poses[static_cast<std::size_t>(trees.root_link[tree])] = trees.roots[tree].pose;
  for (const int j : trees.joints_depth_first) {
    const Joint& own = model.joints[static_cast<std::size_t>(j)];
    Eigen::Isometry3d pose(own.origin);
    if (own.kind == JointKind::prismatic)
      pose.translate(q.at(own.name) * own.axis);
    else if (own.moves())
      pose.rotate(Eigen::AngleAxisd(q.at(own.name), own.axis));
    poses[static_cast<std::size_t>(model.link_index(own.child))] =
        poses[static_cast<std::size_t>(model.link_index(own.parent))] * pose;
  }
  return poses;
}

// MuJoCo's error of a connect or weld: of the first point against the second, then of the first frame in the second.
std::vector<double> misses_of(const Loop& loop, const Model& model, const std::vector<Eigen::Isometry3d>& poses,
                              bool is_swapped) {
  const auto in_world = [&](const string& link, const Pose& pose) {
    return link.empty() ? Eigen::Isometry3d(pose)
                        : Eigen::Isometry3d(poses[static_cast<std::size_t>(model.link_index(link))] * pose);
  };
  Eigen::Isometry3d first = in_world(loop.first, loop.first_pose), second = in_world(loop.second, loop.second_pose);
  if (is_swapped) std::swap(first, second);
  const Eigen::Vector3d gap = first.translation() - second.translation();
  const Eigen::Quaterniond turn(Eigen::Matrix3d(second.linear().transpose() * first.linear()));
  if (loop.kind == LoopKind::point) return {gap[0], gap[1], gap[2]};
  return {gap[0], gap[1], gap[2], turn.x(), turn.y(), turn.z()};
}

TEST(MjcfLoops, miss_by_what_they_miss_in_mujoco) {
  const json facts = facts_of("loops")["missed"];
  const Import import = import_mjcf_file(folder / "models/loops.xml");
  const Model& model = import.model;
  const std::vector<Eigen::Isometry3d> poses = link_poses(model, facts["positions"].get<Efforts>());
  // Equalities whose second end is in the world: it comes first in a loop.
  const std::set<string> swapped = {"grounded", "to the world", "pulled", "on a hook"};
  ASSERT_EQ(model.loops.size(), facts["equalities"].size());
  for (std::size_t i = 0; i < model.loops.size(); ++i) {
    const Loop& loop = model.loops[i];
    SCOPED_TRACE(loop.name);
    EXPECT_EQ(loop.name, facts["equalities"][i]["name"]);
    EXPECT_EQ(loop.first.empty(), swapped.contains(loop.name) || loop.name == "led");
    const std::vector<double> own = misses_of(loop, model, poses, swapped.contains(loop.name)),
                              wanted = facts["equalities"][i]["misses"];
    ASSERT_LE(own.size(), wanted.size());
    double sign = 1.0;  // a quaternion and its opposite are one turn
    for (std::size_t k = 3; k < own.size(); ++k)
      if (std::abs(wanted[k]) > 1e-3) sign = wanted[k] * own[k] < 0.0 ? -1.0 : 1.0;
    for (std::size_t k = 0; k < wanted.size(); ++k)
      EXPECT_NEAR(k >= own.size() ? 0.0 : (k < 3 ? 1.0 : sign) * own[k], wanted[k], 1e-12) << k;
  }
}

// Where a file gives no pose, the drawn one closes the loop.
TEST(MjcfLoops, close_in_the_drawn_pose) {
  const Import import = import_mjcf_file(folder / "models/loops.xml");
  Efforts drawn;
  for (const Joint& own : import.model.joints) drawn[own.name] = own.position;
  const std::vector<Eigen::Isometry3d> poses = link_poses(import.model, drawn);
  int closed = 0;
  for (const Loop& loop : import.model.loops) {
    if (loop.name != "anchored" && loop.name != "grounded" && !loop.name.starts_with("drawn") &&
        loop.name != "position without a turn" && loop.name != "pulled")
      continue;
    for (const double miss : misses_of(loop, import.model, poses, false)) EXPECT_NEAR(miss, 0.0, 1e-13) << loop.name;
    ++closed;
  }
  EXPECT_EQ(closed, 6);
}

TEST(MjcfFunctions, miss_by_what_they_miss_in_mujoco) {
  const json facts = facts_of("functions")["missed"];
  const Model model = import_mjcf_file(folder / "models/functions.xml").model;
  const Efforts q = facts["positions"];
  std::vector<double> own, wanted;
  for (const Coupling& coupling : model.couplings)
    if (coupling.function)
      own.push_back(q.at(coupling.joint) - value_of(*coupling.function, q.at(coupling.terms[0].joint)).first);
  for (const json& fact : facts["equalities"])
    if (fact["name"] != "") wanted.push_back(fact["misses"][0]);
  ASSERT_EQ(own.size(), 3u);
  ASSERT_EQ(wanted.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(own[i], wanted[i], 1e-14);
  // k = 30 degrees + 0.2, and l = 0.1 + 0.2 * 0.2 + 0.3 * 0.2^2 stand still.
  EXPECT_FALSE(joint(model, "k").moves());
  EXPECT_FALSE(joint(model, "l").moves());
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(joint(model, "l").origin.linear()));
  EXPECT_NEAR(turn.angle(), 0.152, 1e-14);
  const Model moving = import_mjcf_file(folder / "models/functions.xml", {.keyframe = "moving"}).model;
  const double u = 0.3 + 10.0 * EIGEN_PI / 180.0;
  EXPECT_NEAR(joint(moving, "s").velocity, 0.5 * (0.05 + 2.0 * 0.04 * u), 1e-15);
  // They start where they hold, the last of a chain, too.
  const double x = -10.0 * EIGEN_PI / 180.0, z = 5.0 * EIGEN_PI / 180.0 + 0.1;
  EXPECT_NEAR(joint(model, "x").position, x, 1e-15);
  EXPECT_NEAR(joint(model, "y").position, 20.0 * EIGEN_PI / 180.0 + 0.1, 1e-15);
  EXPECT_NEAR(joint(model, "s").position, 0.12, 1e-15);
  EXPECT_NEAR(joint(model, "z").position, z, 1e-15);
  EXPECT_NEAR(joint(model, "t").position, 0.3 * 0.1 + 0.1 * 0.001, 1e-15);
}

// Bodies that compensate gravity have a share of it. MuJoCo's forces hold them at rest.
TEST(MjcfGravcomp, leaves_shares_of_gravity_that_the_forces_of_mujoco_hold) {
  const json facts = facts_of("gravcomp");
  const Import import = import_mjcf_file(folder / "models/gravcomp.xml");
  EXPECT_TRUE(import.warnings.empty()) << report_of(import);
  EXPECT_EQ(import.model.gravity, Eigen::Vector3d(1, -2, -9));
  std::map<string, double> shares;
  for (const Link& link : import.model.links)
    if (link.inertia.mass > 0.0) shares[link.name] = link.gravity;
  EXPECT_EQ(shares, (std::map<string, double>{{"upper", 0.25},
                                              {"lower", 1.0},
                                              {"counterweight", -0.5},
                                              {"lift", 1.5},
                                              {"balloon", 0.0},
                                              {"basket", 0.75}}));

  const Plan plan = compile(import.model, {.per_environment = {Parameter::link_wrench}});
  Batch<double> batch(plan, 1);
  for (const json& fact : facts["joints"]) {
    const std::vector<double> holding = fact["holding"];
    if (fact["type"] != "free") {
      batch.positions()(plan.dof(name_of(fact)), 0) = fact["position"];
      batch.efforts()(plan.dof(name_of(fact)), 0) = holding[0];
      continue;
    }
    const Eigen::Map<const Eigen::Vector3d> force(holding.data()), torque(holding.data() + 3);  // in the body's axes
    const int link = import.model.link_index(fact["body"]);
    batch.parameter(Parameter::link_wrench).col(0).segment(6 * link, 6)
        << (import.model.roots.back().pose.linear() * torque).array(),
        force.array();
  }
  batch.step();
  EXPECT_LT(batch.velocities().abs().maxCoeff(), 1e-10);
  EXPECT_LT(batch.root_velocities().abs().maxCoeff(), 1e-10);
}

TEST(MjcfGravcomp, is_off_where_all_passive_forces_are) {
  const auto share = [](const string& flags) {
    return import_mjcf(
               "<mujoco><option><flag " + flags +
               "/></option><worldbody><body gravcomp='0.25'><joint/><geom size='1'/></body></worldbody></mujoco>")
        .model.links.back()
        .gravity;
  };
  EXPECT_EQ(share(""), 0.75);
  EXPECT_EQ(share("spring='disable'"), 0.75);
  EXPECT_EQ(share("damper='disable'"), 0.75);
  EXPECT_EQ(share("spring='disable' damper='disable'"), 1.0);
  EXPECT_EQ(share("passive='disable'"), 1.0);  // as older files say it
}

std::vector<string> models() {
  std::vector<string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "models"))
    if (entry.path().extension() == ".xml") names.push_back(entry.path().stem());
  std::sort(names.begin(), names.end());
  return names;
}
INSTANTIATE_TEST_SUITE_P(models, MjcfFacts, testing::ValuesIn(models()), [](const auto& name) { return name.param; });

TEST(MjcfContacts, are_the_pairs_of_mujoco) {
  for (const string model : {"attached", "contacts"}) {
    SCOPED_TRACE(model);
    std::set<std::tuple<string, string, double, double, double>> wanted, own;
    const json facts = facts_of(model);
    for (const json& pair : facts["pairs"]) {
      const auto [first, second] = std::minmax({pair[0].get<string>(), pair[1].get<string>()});
      wanted.emplace(first, second, pair[2], pair[3], pair[4]);
    }
    const Import import = import_mjcf_file(folder / "models" / (model + ".xml"), {.colliders = true});
    for (const Contact& contact : import.model.contacts)
      own.emplace(std::min(contact.first, contact.second), std::max(contact.first, contact.second), *contact.friction,
                  contact.torsional_friction.value_or(0.0), contact.rolling_friction.value_or(0.0));
    EXPECT_EQ(own, wanted);
    EXPECT_EQ(import.model.contacts.size(), wanted.size());
  }
}

}  // namespace
}  // namespace lockstep
