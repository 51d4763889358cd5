// Simbody as a peer: pins, coordinate couplers, mobility springs and dampers. SPDX-License-Identifier: Apache-2.0
#include <Simbody.h>
#include <fmt/format.h>

#include "peer.h"

namespace lockstep::peers {
namespace {

using namespace SimTK;

struct Options {
  double accuracy = 0.0;         // of the error-controlled integrator; 0: semi-explicit Euler with the given step
  TargetsOverTime targets = {};  // of the servos, at the integrator's times; empty: those of set_targets() hold
};

Vec3 vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Rotation rotation(const Eigen::Matrix3d& r) {
  return Rotation(Mat33(r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2)));
}
Transform transform(const Pose& pose) { return {rotation(pose.linear()), vector(pose.translation())}; }

MassProperties mass(const lockstep::Inertia& inertia) {
  const Eigen::Vector3d moments = inertia.about_center.diagonal();
  const SimTK::Inertia central(moments.x(), moments.y(), moments.z());
  const Vec3 center = vector(inertia.center);
  return {inertia.mass, center, central.shiftFromMassCenter(center, inertia.mass)};
}

// Springs to targets that move with time. Those of a MobilityLinearSpring do not move.
class MovingServos : public Force::Custom::Implementation {
 public:
  struct Servo {
    int joint;
    MobilizedBody body;
    double kp;
  };
  MovingServos(std::vector<Servo> servos, TargetsOverTime targets)
      : servos_(std::move(servos)), targets_(std::move(targets)) {}

  void calcForce(const State& state, Vector_<SpatialVec>&, Vector_<Vec3>&, Vector& mobility_forces) const override {
    const Eigen::VectorXd targets = targets_(state.getTime());
    for (const Servo& servo : servos_)
      servo.body.applyOneMobilityForce(state, 0, servo.kp * (targets[servo.joint] - servo.body.getOneQ(state, 0)),
                                       mobility_forces);
  }
  Real calcPotentialEnergy(const State&) const override { return 0.0; }  // is not used

 private:
  std::vector<Servo> servos_;
  TargetsOverTime targets_;
};

// One system, and a State and an integrator for each environment.
class SimbodyPeer : public Peer {
 public:
  SimbodyPeer(const Model& model, double dt, int environments, const Options& options)
      : model_(model), dt_(dt), accuracy_(options.accuracy) {
    Force::UniformGravity(forces_, matter_, vector(model.gravity));
    build_bodies(options.targets);
    for (const Coupling& coupling : model.couplings) build_coupler(coupling);
    start_ = system_.realizeTopology();
    system_.realizeModel(start_);
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      body(model.joints[j].child).setOneQ(start_, 0, model.joints[j].position);
      body(model.joints[j].child).setOneU(start_, 0, model.joints[j].velocity);
    }
    integrators_.resize(environments);
    SimbodyPeer::reset();
  }

  void reset() override {
    failed_ = false;
    for (auto& integrator : integrators_) {
      if (accuracy_ > 0.0) {
        integrator = std::make_unique<RungeKuttaMersonIntegrator>(system_);
        integrator->setAccuracy(accuracy_);
      } else {
        integrator = std::make_unique<SemiExplicitEulerIntegrator>(system_, dt_);
      }
      integrator->initialize(start_);
    }
  }
  void set_targets(const Eigen::VectorXd& targets) override {
    for (auto& integrator : integrators_)
      for (const auto& [joint, spring] : springs_) spring.setQZero(integrator->updAdvancedState(), targets[joint]);
  }
  void step() override {
    for (auto& integrator : integrators_) step(*integrator);
  }
  Eigen::VectorXd positions() const override {
    const State& state = integrators_[0]->getAdvancedState();
    Eigen::VectorXd q(model_.joints.size());
    for (std::size_t j = 0; j < model_.joints.size(); ++j) q[j] = body(model_.joints[j].child).getOneQ(state, 0);
    return q;
  }
  bool failed() const override { return failed_; }

 private:
  const MobilizedBody& body(const std::string& link) const {
    return matter_.getMobilizedBody(mobod_[model_.link_index(link)]);
  }

  void build_bodies(const TargetsOverTime& targets) {
    mobod_.resize(model_.links.size());
    const Root root = root_of(model_);
    if (root.floating) {
      const Body::Rigid base(mass(model_.links[0].inertia));
      MobilizedBody::Free free(matter_.Ground(), transform(root.pose), base, Transform());
      mobod_[0] = free.getMobilizedBodyIndex();
    }
    std::vector<MovingServos::Servo> servos;
    for (const Joint& joint : model_.joints) {  // a Pin turns about z
      const Rotation to_axis(UnitVec3(vector(joint.axis)), ZAxis);
      const bool on_ground = !root.floating && joint.parent == model_.links[0].name;
      MobilizedBody& parent =
          on_ground ? matter_.updGround() : matter_.updMobilizedBody(mobod_[model_.link_index(joint.parent)]);
      const Transform origin = on_ground ? transform(root.pose * joint.origin) : transform(joint.origin);
      const int child = model_.link_index(joint.child);
      MobilizedBody::Pin pin(parent, origin * Transform(to_axis), Body::Rigid(mass(model_.links[child].inertia)),
                             Transform(to_axis));
      mobod_[child] = pin.getMobilizedBodyIndex();
      const double damping = joint.damping + joint.drive.kd;  // kd is damping, as the velocity target is zero
      if (damping > 0.0) Force::MobilityLinearDamper(forces_, pin, MobilizerUIndex(0), damping);
      if (!(joint.drive.kp > 0.0)) continue;
      const int number = joint_of_link(model_, joint.child);
      if (targets)
        servos.push_back({number, pin, joint.drive.kp});
      else
        springs_.emplace_back(number,
                              Force::MobilityLinearSpring(forces_, pin, MobilizerQIndex(0), joint.drive.kp, 0.0));
    }
    if (!servos.empty()) Force::Custom(forces_, new MovingServos(std::move(servos), targets));  // Simbody deletes it
  }

  void build_coupler(const Coupling& coupling) {
    const CouplingTerm& other = coupling.terms[0];
    Vector terms(3);
    terms[0] = 1.0, terms[1] = other.ratio, terms[2] = coupling.offset;
    Array_<MobilizedBodyIndex> bodies;
    for (const std::string& joint : {coupling.joint, other.joint})
      bodies.push_back(mobod_[model_.link_index(model_.joints[model_.joint_index(joint)].child)]);
    Constraint::CoordinateCoupler(matter_, new Function::Linear(terms), bodies,
                                  Array_<MobilizerQIndex>(2, MobilizerQIndex(0)));
  }

  void step(Integrator& integrator) {
    if (failed_) return;
    try {
      accuracy_ > 0.0 ? step_until(integrator, integrator.getTime() + dt_)
                      : void(integrator.stepTo(integrator.getAdvancedTime() + dt_));
    } catch (const std::exception&) {  // Simbody throws if its state is NaN, or if a step does not end
      failed_ = true;
    }
  }

  // With `end` as an event too: otherwise error control would step beyond it and interpolate.
  static void step_until(Integrator& integrator, double end) {
    do integrator.stepTo(end, end);
    while (integrator.getTime() < end);
    integrator.reinitialize(Stage::Time, false);
  }

  Model model_;
  double dt_, accuracy_;
  MultibodySystem system_;
  SimbodyMatterSubsystem matter_{system_};
  GeneralForceSubsystem forces_{system_};
  std::vector<MobilizedBodyIndex> mobod_;  // by link
  std::vector<std::pair<int, Force::MobilityLinearSpring>> springs_;
  State start_;
  std::vector<std::unique_ptr<Integrator>> integrators_;
  bool failed_ = false;
};

}  // namespace

std::vector<Contender> simbody_contenders() {
  const std::pair<const char*, Options> choices[] = {{"semi-explicit Euler, f64", {}},
                                                     {"Runge-Kutta-Merson, 1e-3, f64", {.accuracy = 1e-3}}};
  std::vector<Contender> all;
  for (const auto& [words, options] : choices)
    all.push_back({.engine = "Simbody",
                   .settings = words,
                   .environments = 1,
                   .make = [options = options](const Model& model, double dt, int environments) {
                     return std::make_unique<SimbodyPeer>(model, dt, environments, options);
                   }});
  return all;
}

std::unique_ptr<Peer> simbody_motion(const Model& model, double interval, const TargetsOverTime& targets,
                                     double accuracy) {
  require_plain(model);
  return std::make_unique<SimbodyPeer>(model, interval, 1, Options{.accuracy = accuracy, .targets = targets});
}

}  // namespace lockstep::peers
