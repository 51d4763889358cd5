// The hashes of a plan, and its settings in lines of text. SPDX-License-Identifier: Apache-2.0
//
// Structures are taken apart by structured bindings, so a field that is added to one and not named here is an error.
#include "identity.h"

#include <fmt/format.h>

#include <bit>

#include "hash.h"
#include "model/softness_numbers.h"
#include "program.h"

namespace lockstep {
namespace {

class ModelHash {
 public:
  explicit ModelHash(const Model& model) { put(std::uint64_t{identity_format}), put(model); }
  std::uint64_t value() const { return hash_.value(); }

 private:
  template <class... Field>
  void all(const Field&... fields) {
    (put(fields), ...);
  }

  void put(std::uint64_t number) { hash_.add(number); }
  void put(double number) { put(std::bit_cast<std::uint64_t>(number)); }
  void put(bool yes) { put(std::uint64_t{yes}); }
  void put(JointKind kind) { put(static_cast<std::uint64_t>(kind)); }
  void put(const std::string& text) {
    put(std::uint64_t{text.size()});
    hash_.add(std::string_view(text));
  }
  template <class E>
  void put(const std::vector<E>& list) {
    put(std::uint64_t{list.size()});
    for (const E& element : list) put(element);
  }
  template <class Derived>
  void put(const Eigen::DenseBase<Derived>& matrix) {
    for (Eigen::Index row = 0; row < matrix.rows(); ++row)
      for (Eigen::Index column = 0; column < matrix.cols(); ++column) put(double{matrix(row, column)});
  }
  void put(const Pose& pose) { put(pose.affine()); }
  void put(const Softness& softness) {
    const auto [first, second] = numbers_of(softness);
    all(static_cast<std::uint64_t>(softness.index()), first, second);
  }
  void put(const Inertia& inertia) {
    const auto& [mass, center, about_center] = inertia;
    all(mass, center, about_center);
  }
  void put(const Link& link) {
    const auto& [name, inertia, gravity] = link;
    all(name, inertia, gravity);
  }
  void put(const Drive& drive) {
    const auto& [kp, kd, position_target, velocity_target, kinematic, softness, delay, lag, stall_effort,
                 no_load_speed] = drive;
    all(kp, kd, position_target, velocity_target, kinematic, softness, static_cast<std::uint64_t>(delay), lag,
        stall_effort, no_load_speed);
  }
  void put(const Joint& joint) {
    const auto& [name, kind, parent, child, origin, axis, damping, armature, stiffness, rest, drive, effort, lower,
                 upper, limit_softness, restitution, velocity_limit, effort_limit, friction, position, velocity, path] =
        joint;
    all(name, kind, parent, child, origin, axis, damping, armature, stiffness, rest, drive, effort, lower, upper,
        limit_softness, restitution, velocity_limit, effort_limit, friction, position, velocity);
    if (!path.empty()) put(path);
  }
  void put(const TendonSegment& segment) {
    const auto& [first, second, first_point, second_point, share] = segment;
    all(first, second, first_point, second_point, share);
  }
  void put(const CouplingTerm& term) {
    const auto& [joint, ratio] = term;
    all(joint, ratio);
  }
  void put(const Coupling& coupling) {
    const auto& [joint, terms, offset, softness, force_limit, function] = coupling;
    all(joint, terms, offset, softness, force_limit, function);
  }
  void put(const Polynomial& polynomial) {
    const auto& [coefficients] = polynomial;
    put(coefficients);
  }
  void put(const CamTable& table) {
    const auto& [leader, follower] = table;
    all(leader, follower);
  }
  void put(const Harmonic& harmonic) {
    const auto& [mean, cosine, sine, rate] = harmonic;
    all(mean, cosine, sine, rate);
  }
  void put(const Function& function) {
    put(static_cast<std::uint64_t>(function.index()));
    std::visit([&](const auto& kind) { put(kind); }, function);
  }
  void put(const Loop& loop) {
    const auto& [name, kind, first, second, first_pose, second_pose, axis, softness, force_limit, torque_limit] = loop;
    all(name, static_cast<std::uint64_t>(kind), first, second, first_pose, second_pose, axis, softness, force_limit,
        torque_limit);
  }
  void put(const Site& site) {
    const auto& [name, link, pose] = site;
    all(name, link, pose);
  }
  void put(const Shape& shape) {
    const auto& [kind, size, points, heights] = shape;
    all(static_cast<std::uint64_t>(kind), size, static_cast<std::uint64_t>(points.cols()), points,
        static_cast<std::uint64_t>(heights.cols()), heights);
  }
  void put(const Collider& collider) {
    const auto& [name, link, shape, pose, friction, restitution, softness, group, torsional, rolling] = collider;
    all(name, link, shape, pose, friction, restitution, softness, group, torsional, rolling);
  }
  template <class E>
  void put(const std::optional<E>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  void put(const Contact& contact) {
    const auto& [first, second, friction, restitution, softness, torsional, rolling] = contact;
    all(first, second, friction, restitution, softness, torsional, rolling);
  }
  void put(const Root& root) {
    const auto& [link, floating, pose, velocity] = root;
    all(link, floating, pose, velocity);
  }
  template <class E>
  void put(const std::map<std::string, E>& by_name) {
    put(std::uint64_t{by_name.size()});
    for (const auto& [name, value] : by_name) all(name, value);
  }
  void put(const NamedPose& pose) {
    const auto& [name, positions, velocities, position_targets, velocity_targets, efforts, root_poses,
                 root_velocities] = pose;
    all(name, positions, velocities, position_targets, velocity_targets, efforts, root_poses, root_velocities);
  }
  void put(const Model& model) {
    const auto& [name, links, joints, couplings, loops, sites, colliders, contacts, roots, gravity, poses, time_step] =
        model;
    all(name, links, joints, couplings, loops, sites, colliders, contacts, roots, gravity, poses, time_step);
  }

  Hash hash_;
};

std::string words_of(const JointSet& set) {
  const auto& [all, followers, names] = set;
  std::string words = fmt::format("{}{}", all ? " all" : "", followers ? " followers" : "");
  for (const std::string& name : names) words += fmt::format(" {}'{}'", name.size(), name);
  return words.empty() ? " none" : words;
}

std::string words_of(const ParameterSet& set) {
  std::string words;
  for (unsigned p = 0; p < parameter_count; ++p)
    if (set.contains(Parameter{p})) words += fmt::format(" {}", to_string(Parameter{p}));
  return words.empty() ? " none" : words;
}

std::string lines_of(const StepSettings& settings) {
  const auto& [dt, method, integrator, iterations, velocity_iterations, per_environment, ignore, stage_inputs,
               record_impulses, record_diagnostics, record_efforts, record_contacts, record_accelerations, guard,
               contacts, position_bound, velocity_bound] = settings;
  const auto& [passes, rounds, tolerance] = contacts;
  const auto& [position_limits, velocity_limits, effort_limits, friction] = ignore;
  return fmt::format("dt {}\nmethod {}\nintegrator {}\niterations {}\nvelocity_iterations {}\nper_environment{}\n", dt,
                     to_string(method), to_string(integrator), iterations, velocity_iterations,
                     words_of(per_environment)) +
         fmt::format("ignore.position_limits{}\nignore.velocity_limits{}\nignore.effort_limits{}\nignore.friction{}\n",
                     words_of(position_limits), words_of(velocity_limits), words_of(effort_limits),
                     words_of(friction)) +
         fmt::format("stage_inputs {}\nrecord_impulses {}\nrecord_diagnostics {}\n", stage_inputs, record_impulses,
                     record_diagnostics) +
         fmt::format("record_efforts {}\nrecord_contacts {}\nrecord_accelerations {}\n", record_efforts,
                     record_contacts, record_accelerations) +
         fmt::format("guard {}\nposition_bound {}\nvelocity_bound {}\n", guard, position_bound, velocity_bound) +
         fmt::format("contacts.passes {}\ncontacts.rounds {}\ncontacts.tolerance {}\n", passes, rounds, tolerance);
}

}  // namespace

const Identity& identity_of(const Program& program) {
  return program.identity.get([&] {
    const std::uint64_t model = ModelHash(program.model).value();
    std::string settings = lines_of(program.settings);
    Hash plan;
    plan.add(model);
    plan.add(std::string_view(settings));
    return std::make_shared<const Identity>(Identity{plan.value(), model, std::move(settings)});
  });
}

}  // namespace lockstep
