// Models of every kind of row, built from the input, compiled and stepped: refused or sound, no neighbour changed, and
// as the reference has it where that has such models. SPDX-License-Identifier: Apache-2.0
#include <fuzzer/FuzzedDataProvider.h>

#include <cmath>
#include <cstring>
#include <stdexcept>

#include "fuzz.h"
#include "physics.h"
#include "reference/step.h"

using namespace lockstep;

namespace {

constexpr int environments = 5, spoiled = 2;

class Builder {
 public:
  Builder(const std::uint8_t* data, std::size_t size) : input_(data, size) {}

  Model model() {
    Model model;
    const int links = whole(1, 6);
    for (int i = 0; i < links; ++i) {
      model.links.push_back({"l" + std::to_string(i), {}});
      Inertia& inertia = model.links.back().inertia;
      inertia.mass = real(0.1, 2.0), inertia.center = vector(0.1);
      inertia.about_center = Eigen::Vector3d::Constant(inertia.mass * real(0.01, 0.1)).asDiagonal();
      if (i > 0) add_joint(model, i);
    }
    if (chance()) model.roots.push_back({"l0", true, Pose::Identity(), Twist::Constant(real(-1.0, 1.0))});
    if (chance()) model.gravity = vector(10.0);
    for (int i = whole(0, 3); i > 0 && model.joints.size() > 1; --i) add_coupling(model);
    if (one_in(4)) add_loop(model);
    if (one_in(4)) add_tendon(model);
    for (int i = one_in(2) ? whole(1, 3) : 0; i > 0; --i) add_collider(model);
    return model;
  }

  StepSettings settings() {
    StepSettings settings;
    settings.method =
        input_.PickValueInArray({Method::automatic, Method::reduced, Method::direct, Method::pgs, Method::tgs});
    settings.integrator = input_.PickValueInArray({Integrator::euler, Integrator::automatic, Integrator::leapfrog,
                                                   Integrator::extrapolated, Integrator::runge_kutta});
    settings.dt = input_.PickValueInArray({1.0 / 240.0, 1e-3, 1.0 / 60.0});
    settings.iterations = whole(1, 6), settings.velocity_iterations = whole(0, 2);
    if (one_in(3)) settings.per_environment.insert(static_cast<Parameter>(whole(0, parameter_count - 1)));
    settings.stage_inputs = one_in(8), settings.record_impulses = one_in(8), settings.record_diagnostics = one_in(8);
    settings.record_efforts = one_in(8), settings.record_contacts = one_in(8);
    settings.record_accelerations = one_in(8);
    return settings;
  }

 private:
  int whole(int low, int high) { return input_.ConsumeIntegralInRange(low, high); }
  double real(double low, double high) { return low + (high - low) * (input_.ConsumeIntegral<std::uint8_t>() / 255.0); }
  bool chance() { return input_.ConsumeBool(); }
  bool one_in(int n) { return whole(1, n) == n; }
  Eigen::Vector3d vector(double most) {
    Eigen::Vector3d result;
    for (double& component : result) component = real(-most, most);
    return result;
  }
  Pose pose(double distance) {
    Pose result = Pose::Identity();
    if (chance()) result.linear() = Eigen::AngleAxisd(real(-3.0, 3.0), Eigen::Vector3d::UnitZ()).toRotationMatrix();
    result.translation() = vector(distance);
    return result;
  }
  Softness softness() {
    switch (whole(0, 3)) {
      case 0: return Hard{real(0.0, 1.0)};
      case 1: return Spring{real(0.0, 100.0), real(0.0, 5.0)};
      case 2: return Frequency{real(0.0, 50.0), real(0.0, 2.0)};
      default: return Hard{};
    }
  }
  std::string link_of(const Model& model) {
    return model.links[static_cast<std::size_t>(whole(0, static_cast<int>(model.links.size()) - 1))].name;
  }
  std::string joint_of(const Model& model) {
    return model.joints[static_cast<std::size_t>(whole(0, static_cast<int>(model.joints.size()) - 1))].name;
  }

  void add_joint(Model& model, int child) {
    const std::string name = "j" + std::to_string(child), parent = "l" + std::to_string(whole(0, child - 1));
    if (one_in(5)) {
      model.add_ball(name, parent, "l" + std::to_string(child), pose(0.2));
      return;
    }
    Joint joint{
        name,
        input_.PickValueInArray({JointKind::revolute, JointKind::continuous, JointKind::prismatic, JointKind::fixed}),
        parent, "l" + std::to_string(child), pose(0.2)};
    joint.axis = Eigen::Vector3d::Unit(whole(0, 2));
    joint.armature = real(0.01, 0.1);
    if (chance()) joint.damping = real(0.0, 1.0);
    if (chance()) joint.stiffness = real(0.0, 50.0), joint.rest = real(-1.0, 1.0);
    if (chance())
      joint.drive.kp = real(0.0, 100.0), joint.drive.kd = real(0.0, 10.0),
      joint.drive.position_target = real(-1.0, 1.0);
    if (one_in(6)) joint.drive.delay = whole(0, 3), joint.drive.lag = real(0.0, 0.05);
    if (one_in(6)) joint.drive.stall_effort = real(1.0, 9.0), joint.drive.no_load_speed = real(1.0, 20.0);
    if (one_in(8)) joint.drive = {}, joint.drive.kinematic = true;
    if (chance() && joint.kind != JointKind::continuous) joint.lower = real(-1.0, 0.0), joint.upper = real(0.0, 1.0);
    if (one_in(4)) joint.limit_softness = softness();
    if (one_in(4)) joint.restitution = real(0.0, 1.0);
    if (one_in(3)) joint.velocity_limit = real(0.1, 5.0);
    if (one_in(3)) joint.effort_limit = real(0.0, 10.0);
    if (one_in(3)) joint.friction = real(0.0, 1.0);
    joint.position = real(-0.5, 0.5), joint.velocity = real(-2.0, 2.0);
    model.joints.push_back(joint);
  }
  void add_coupling(Model& model) {
    Coupling coupling{joint_of(model), {}};
    for (int i = whole(1, 2); i > 0; --i) coupling.terms.push_back({joint_of(model), real(-3.0, 3.0)});
    coupling.offset = one_in(4) ? real(-0.1, 0.1) : 0.0;
    coupling.softness = softness();
    if (one_in(5)) coupling.force_limit = real(0.1, 10.0);
    if (one_in(5))
      coupling.terms.resize(1), coupling.terms[0].ratio = 1.0,
                                coupling.function = Polynomial{{0.0, real(-1.0, 1.0), real(-1.0, 1.0)}};
    model.couplings.push_back(coupling);
  }
  void add_loop(Model& model) {
    Loop loop{"loop", input_.PickValueInArray({LoopKind::point, LoopKind::weld, LoopKind::hinge, LoopKind::slider}),
              link_of(model), chance() ? "" : link_of(model)};
    loop.first_pose = pose(0.1), loop.second_pose = pose(0.1), loop.softness = softness();
    model.loops.push_back(loop);
  }
  void add_tendon(Model& model) {
    Joint tendon{"tendon", JointKind::tendon};
    tendon.path.push_back({"", link_of(model), vector(1.0), vector(0.1)});
    tendon.stiffness = real(0.0, 50.0), tendon.rest = real(0.0, 1.0);
    if (chance()) tendon.upper = real(0.5, 2.0);
    model.joints.push_back(tendon);
  }
  void add_collider(Model& model) {
    Collider own;
    own.name = "c" + std::to_string(model.colliders.size()), own.link = link_of(model), own.pose = pose(0.05);
    const double size = real(0.02, 0.1);
    Eigen::Matrix3Xd corners(3, 4);
    corners << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
    const Shape shapes[] = {
        Shape::sphere(size),         Shape::box({size, size, 2 * size}),         Shape::capsule(size, size),
        Shape::cylinder(size, size), Shape::ellipsoid({size, size, 0.5 * size}), Shape::hull(size * corners)};
    own.shape = shapes[whole(0, 5)];
    own.friction = real(0.0, 1.5), own.restitution = real(0.0, 1.0), own.softness = softness();
    if (one_in(3)) own.torsional_friction = real(0.0, 0.05), own.rolling_friction = real(0.0, 0.01);
    Collider ground;
    ground.name = "ground" + own.name, ground.shape = Shape::half_space();
    ground.pose.translation().z() = real(-1.0, 0.0);
    model.contacts.push_back({ground.name, own.name});
    if (!model.colliders.empty() && chance()) model.contacts.push_back({model.colliders[0].name, own.name});
    model.colliders.push_back(own), model.colliders.push_back(ground);
  }

  FuzzedDataProvider input_;
};

// The others than the spoiled one have the bits of a batch in which nothing is spoiled.
template <class S>
void require_isolation(const Plan& plan) {
  Batch<S> clean(plan, environments, {.threads = 1}), dirty(plan, environments, {.threads = 1});
  clean.step(4);
  dirty.positions().col(spoiled).setConstant(std::numeric_limits<S>::quiet_NaN());
  dirty.velocities().col(spoiled).setConstant(S(1e30));
  dirty.step(4);
  fuzz::require_sound(clean), fuzz::require_sound(dirty);
  for (int e = 0; e < environments; ++e) {
    if (e == spoiled) continue;
    for (int dof = 0; dof < plan.dofs(); ++dof) {
      const S a = clean.velocities()(dof, e), b = dirty.velocities()(dof, e);
      fuzz::require(std::memcmp(&a, &b, sizeof a) == 0, "a spoiled environment changes its neighbours");
    }
  }
}

// One step of Euler's against the reference, which throws std::logic_error for what it does not have.
void compare(const Model& model, StepSettings settings, const Plan& plan) {
  if (plan.integrator() != Integrator::euler || !model.contacts.empty() || settings.stage_inputs) return;
  for (const Joint& joint : model.joints)
    if (joint.kind == JointKind::tendon || joint.kind == JointKind::ball || joint.drive.delay > 0 ||
        joint.drive.lag > 0.0 || joint.drive.stall_effort < infinity)
      return;
  settings.method = plan.method(), settings.integrator = Integrator::euler;
  Batch<double> batch(plan, 1, {.threads = 1});
  const reference::Mechanism mechanism(model);
  batch.step(1);
  if (batch.faulted() > 0) return;
  const reference::State ours = physics::state_of(batch);
  try {
    const reference::Step theirs =
        reference::step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
    const Eigen::VectorXd sizes = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(theirs.stage.implicit).eigenvalues();
    if (sizes.size() > 0 && !(sizes[0] > 1e-8 * sizes[sizes.size() - 1])) return;  // rounding grows too much
    const double scale = 1.0 + theirs.state.v.lpNorm<Eigen::Infinity>();
    fuzz::require(physics::distance(ours.v, theirs.state.v) <= 1e-5 * scale, "the step is not the reference's");
  } catch (const std::logic_error&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Builder builder(data, size);
  const Model model = builder.model();
  const StepSettings settings = builder.settings();
  fuzz::taken([&] {
    const Plan plan = compile(model, settings);
    require_isolation<float>(plan);
    require_isolation<double>(plan);
    compare(model, settings, plan);
  });
  return 0;
}
