// Batch: resets to a pose with noise, (M141) and (M142). SPDX-License-Identifier: Apache-2.0
#include "impl.h"

namespace lockstep {
namespace {

constexpr int rows_of_root = 6;  // of draws: x, y, z and three of a rotation; velocities angular, then linear

std::string name_of(const RootNoise& noise) {
  return noise.link.empty() ? "noise of floating roots" : "noise of root '" + noise.link + "'";
}

// `what` of all joints, or of a root.
void require_within(double number, double most, const char* what, const RootNoise* root, const char* range) {
  if (!(number >= 0.0 && number <= most))
    throw UsageError(root ? std::string(what) + " in the " + name_of(*root) : std::string(what) + " of the reset",
                     "is " + std::to_string(number), std::string("give ") + range);
}

struct Angle {
  double sine, cosine;
  explicit Angle(double angle) {
    using One = simd::Wide<double, 1, simd::Unfused>;
    One of_sine, of_cosine;
    simd::sincos(One(angle), of_sine, of_cosine);
    sine = of_sine.lane(0), cosine = of_cosine.lane(0);
  }
};

// (M142): uniform over rotations.
Eigen::Quaterniond uniform_rotation(double first, double second, double third) {
  const double inner = std::sqrt(1.0 - first), outer = std::sqrt(first);
  const Angle a(2.0 * std::numbers::pi * second), b(2.0 * std::numbers::pi * third);
  return {outer * b.cosine, inner * a.sine, inner * a.cosine, outer * b.sine};
}

// What is drawn for a root: the noise that names it, or that of all; null if there is none.
const RootNoise* noise_of(const std::vector<RootNoise>& all, const std::string& link) {
  const RootNoise* found = nullptr;
  for (const RootNoise& noise : all) {
    if (noise.link == link) return &noise;
    if (noise.link.empty()) found = &noise;
  }
  return found;
}

}  // namespace

template <class S>
void Batch<S>::Impl::check_noise(const PoseNoise& noise) const {
  constexpr double most = std::numeric_limits<S>::max();
  constexpr const char* finite = "a finite number of 0 or more";
  check_stream(noise.stream);
  check_couplings(noise.project);
  require_within(noise.position, most, "noise of positions", nullptr, finite);
  require_within(noise.spread, 1.0, "spread", nullptr, "0 to 1");
  require_within(noise.velocity, most, "speed", nullptr, finite);
  const std::vector<std::string>& roots = plan.root_names();
  for (const RootNoise& own : noise.roots) {
    if (!own.link.empty() && std::find(roots.begin(), roots.end(), own.link) == roots.end())
      throw UsageError(name_of(own), "is about no link that floats", "give one of Plan::root_names()");
    if (std::count_if(noise.roots.begin(), noise.roots.end(),
                      [&](const RootNoise& other) { return other.link == own.link; }) > 1)
      throw UsageError(name_of(own), "is given twice", "give it once");
    for (const double number : own.position) require_within(number, most, "position", &own, finite);
    require_within(own.yaw, std::numbers::pi, "yaw", &own, "0 to pi");
    require_within(own.angular_velocity, most, "angular velocity", &own, finite);
    require_within(own.linear_velocity, most, "linear velocity", &own, finite);
  }
}

template <class S>
void Batch<S>::Impl::disturb_joints(int e, const PoseNoise& noise) {
  const Fields& model = fields_of(program_of(plan));
  const AlignedBlock<S>& own = rows.field(Parameter::position_limits);
  const auto limit = [&](int row) {
    return own.size() > 0 ? static_cast<double>(own.data()[row * stride + e])
                          : model.value(Parameter::position_limits, row);
  };
  const std::span balls(tables.balls.data, static_cast<std::size_t>(tables.balls.count));
  const auto first_of = [&](const BallJoint& ball) { return tables.dof[ball.joint]; };
  const auto is_of_ball = [&](int dof) {
    return std::any_of(balls.begin(), balls.end(),
                       [&](const BallJoint& ball) { return first_of(ball) <= dof && dof < first_of(ball) + 3; });
  };
  Draws positions = draws(e, noise.stream, Purpose::position), velocities = draws(e, noise.stream, Purpose::velocity);
  for (const int dof : plan.independent_dofs()) {  // (M141)
    S& position = rows.position.data()[dof * stride + e];
    S& velocity = rows.velocity.data()[dof * stride + e];
    const bool is_free = is_of_ball(dof);  // the range of a ball is that of its angle
    const double at = static_cast<double>(position), lower = is_free ? -infinity : limit(2 * dof),
                 upper = is_free ? infinity : limit(2 * dof + 1);
    const double share = std::isfinite(upper - lower) ? noise.spread : 0.0;
    const double down = noise.position + (share > 0.0 ? share * (at - lower) : 0.0),
                 up = noise.position + (share > 0.0 ? share * (upper - at) : 0.0);
    const double least = std::max(std::min(lower, at), at - down), most = std::min(std::max(upper, at), at + up);
    position = static_cast<S>(least + (most - least) * positions.uniform(dof));
    velocity = static_cast<S>(static_cast<double>(velocity) + noise.velocity * (2.0 * velocities.uniform(dof) - 1.0));
  }
  if (noise.position == 0.0) return;
  for (const BallJoint& ball : balls) {  // comes back into its range
    const int first = first_of(ball);
    S* const part[] = {rows.position.data() + first * stride + e, rows.position.data() + (first + 1) * stride + e,
                       rows.position.data() + (first + 2) * stride + e};
    const double angle =
        std::hypot(static_cast<double>(*part[0]), static_cast<double>(*part[1]), static_cast<double>(*part[2]));
    const double share = angle > limit(2 * first + 1) ? limit(2 * first + 1) / angle : 1.0;
    for (S* const component : part) *component = static_cast<S>(share * static_cast<double>(*component));
  }
}

template <class S>
void Batch<S>::Impl::disturb_roots(int e, const PoseNoise& noise) {
  const std::vector<std::string>& roots = plan.root_names();
  Draws poses_drawn = draws(e, noise.stream, Purpose::root_pose),
        velocities_drawn = draws(e, noise.stream, Purpose::root_velocity);
  for (std::size_t r = 0; r < roots.size(); ++r) {
    const RootNoise* const own = noise_of(noise.roots, roots[r]);
    if (!own) continue;
    const int root = static_cast<int>(r), first = rows_of_root * root;
    const auto row = [&](const AlignedBlock<S>& block, int k) -> S& { return block.data()[k * stride + e]; };
    const auto add = [&](S& number, double change) { number = static_cast<S>(static_cast<double>(number) + change); };
    const auto either_side = [](Draws& drawn, int k) { return 2.0 * drawn.uniform(k) - 1.0; };

    for (int k = 0; k < 3; ++k)
      add(row(rows.root_pose, 7 * root + k), own->position[k] * either_side(poses_drawn, first + k));
    const auto number = [&](int k) { return static_cast<double>(row(rows.root_pose, 7 * root + k)); };
    Eigen::Quaterniond turn(number(3), number(4), number(5), number(6));
    if (own->any_rotation) {
      turn = uniform_rotation(poses_drawn.uniform(first + 3), poses_drawn.uniform(first + 4),
                              poses_drawn.uniform(first + 5));
    } else if (own->yaw > 0.0) {
      const Angle half(0.5 * own->yaw * either_side(poses_drawn, first + 3));
      turn = Eigen::Quaterniond(half.cosine, 0.0, 0.0, half.sine) * turn;
    }
    if (own->any_rotation || own->yaw > 0.0) {
      const double numbers[] = {turn.w(), turn.x(), turn.y(), turn.z()};
      for (int k = 0; k < 4; ++k) row(rows.root_pose, 7 * root + 3 + k) = static_cast<S>(numbers[k]);
    }
    for (const int half : {0, 1}) {
      const double most = half == 0 ? own->angular_velocity : own->linear_velocity;
      if (most == 0.0) continue;
      Eigen::Vector3d change;  // in the world's axes, then in the root's
      for (int k = 0; k < 3; ++k) change[k] = most * either_side(velocities_drawn, first + 3 * half + k);
      change = turn.normalized().conjugate() * change;
      for (int k = 0; k < 3; ++k) add(row(rows.root_velocity, 6 * root + 3 * half + k), change[k]);
    }
  }
}

template <class S>
std::vector<UnmetCoupling> Batch<S>::Impl::reset_to(const EnvironmentSet& which, int pose, const PoseNoise& noise) {
  const int count = static_cast<int>(poses.size());
  if (pose < -1 || pose >= count)
    throw UsageError("pose " + std::to_string(pose), "is none of the model's " + std::to_string(count),
                     "give a number of Model::poses, or -1 for the model's own start");
  check_noise(noise);
  const BatchRows<S, Numbers>& to = pose < 0 ? start : poses[static_cast<std::size_t>(pose)];
  which.for_each(environments, [&](int e) {
    reset(e, noise.keep_inputs, to);
    const simd::StepMode mode;
    disturb_joints(e, noise);
    if (!noise.roots.empty()) disturb_roots(e, noise);
  });
  std::vector<UnmetCoupling> unmet;
  which.for_each(environments, [&](int e) { project(e, noise.project, unmet); });
  return unmet;
}

template <class S>
std::vector<UnmetCoupling> Batch<S>::reset_to(const EnvironmentSet& which, int pose, const PoseNoise& noise) {
  const Alone alone(impl().in_use);
  return impl().reset_to(which, pose, noise);
}

template <class S>
std::vector<UnmetCoupling> Batch<S>::reset_to(const EnvironmentSet& which, const std::string& pose,
                                              const PoseNoise& noise) {
  return reset_to(which, pose.empty() ? -1 : plan().pose(pose), noise);
}

template <class S>
std::vector<UnmetCoupling> Batch<S>::reset_random(const EnvironmentSet& which, const RandomReset& how) {
  PoseNoise noise;
  noise.spread = how.spread, noise.velocity = how.speed, noise.stream = how.stream;
  noise.keep_inputs = how.keep_inputs, noise.project = how.project;
  return reset_to(which, -1, noise);
}

template std::vector<UnmetCoupling> Batch<float>::reset_to(const EnvironmentSet&, int, const PoseNoise&);
template std::vector<UnmetCoupling> Batch<double>::reset_to(const EnvironmentSet&, int, const PoseNoise&);
template std::vector<UnmetCoupling> Batch<float>::reset_to(const EnvironmentSet&, const std::string&, const PoseNoise&);
template std::vector<UnmetCoupling> Batch<double>::reset_to(const EnvironmentSet&, const std::string&,
                                                            const PoseNoise&);
template std::vector<UnmetCoupling> Batch<float>::reset_random(const EnvironmentSet&, const RandomReset&);
template std::vector<UnmetCoupling> Batch<double>::reset_random(const EnvironmentSet&, const RandomReset&);

}  // namespace lockstep
