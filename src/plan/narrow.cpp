// The tables in single precision. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "layout.h"

namespace lockstep {
namespace {

// Single precision of everything, remembering whether it could hold it all.
struct Narrowing {
  Store& store;
  bool all_fit = true;

  float narrowed(double value) {
    const float single = static_cast<float>(value);
    all_fit = all_fit && std::isfinite(single);
    return single;
  }

  template <int N>
  void copy(const double (&from)[N], float (&to)[N]) {
    for (int i = 0; i < N; ++i) to[i] = narrowed(from[i]);
  }

  Body<float> narrowed(const Body<double>& from) {
    Body<float> to{from.parent, from.axis, from.prismatic, from.rotated, from.root, from.kind, from.first, from.leaf,
                   from.heavy, from.diagonal, narrowed(from.sign), {}, {}, narrowed(from.mass), {}, {},
                   narrowed(from.felt_mass), {}, {}};
    copy(from.rotation, to.rotation);
    copy(from.offset, to.offset);
    copy(from.moment, to.moment);
    copy(from.second, to.second);
    copy(from.felt_moment, to.felt_moment);
    copy(from.felt_second, to.felt_second);
    return to;
  }

  LinkPlace<float> narrowed(const LinkPlace<double>& from) {
    LinkPlace<float> to{from.body, {}, {}, {}, {}};
    copy(from.rotation, to.rotation);
    copy(from.offset, to.offset);
    copy(from.unit_moment, to.unit_moment);
    copy(from.unit_second, to.unit_second);
    return to;
  }

  RowSoftness<float> narrowed(const RowSoftness<double>& from) {
    return {from.kind, narrowed(from.rate), narrowed(from.cfm), narrowed(from.cfm_per_response)};
  }

  Reduction<float>::Fill narrowed(const Reduction<double>::Fill& from) {
    return {from.entry, from.gear, narrowed(from.value)};
  }
  Reduction<float>::Elimination narrowed(const Reduction<double>::Elimination& from) {
    return {from.factor, from.pivot, from.first, from.last};
  }
  Reduction<float>::Update narrowed(const Reduction<double>::Update& from) { return {from.target, from.source}; }

  template <class E>
  auto narrowed(Span<E> from) {
    std::vector<decltype(narrowed(from[0]))> to;
    for (int i = 0; i < from.count; ++i) to.push_back(narrowed(from[i]));
    return store.keep(std::move(to));
  }

  Rows<float> narrowed(const Rows<double>& from) {
    return {from.count, from.coupling, from.term_start, from.term_index, narrowed(from.term_value),
            from.contribution_start, from.contribution, from.support_start, from.support, from.run_start, from.runs,
            from.groups, from.group_support, from.group_runs, from.blocks, from.block_runs, from.dense, from.known, from.all_known, from.prescribed, from.neighbour_start,
            from.neighbours, from.response_entries, from.columns, narrowed(from.softness)};
  }

  Watched<float> narrowed(const Watched<double>& from) {
    return {from.joint, narrowed(from.lower), narrowed(from.upper), narrowed(from.way), from.bounces};
  }

  Bounds<float> narrowed(const Bounds<double>& from) {
    return {narrowed(from.form), from.kind, from.member_start, from.member, narrowed(from.member_share),
            from.may_depend, from.driven, from.always, narrowed(from.watched), from.has, narrowed(from.lower), narrowed(from.upper),
            narrowed(from.limit_rate), narrowed(from.restitution), narrowed(from.speed_limit), narrowed(from.friction),
            narrowed(from.drive_rate), narrowed(from.sub_step_rate), narrowed(from.force_limit), narrowed(from.soft_rate),
            from.natural_row};
  }

  Reduction<float> narrowed(const Reduction<double>& from) {
    return {from.followers, from.by_force, from.merged, from.speed, from.measured, from.follower, from.follower_of, from.independent, from.start,
            from.column, from.driver, narrowed(from.value), from.placing, from.shortens, from.pairs, from.mirrors, from.collect_start, from.collected, from.momentum_start, from.momentum,
            from.inverse_start, from.inverse_coupling, narrowed(from.inverse_value), narrowed(from.rate),
            from.product_groups, from.product_entry, from.product_start, from.product_source, narrowed(from.product_value), from.product_left,
            from.product_right, from.entries, narrowed(from.fills), narrowed(from.eliminations),
            narrowed(from.updates), from.pivot, from.value_entry, from.inverse_entry};
  }
};

}  // namespace

void narrow(Program& program) {
  const Tables<double>& from = program.f64;
  Tables<float>& to = program.f32;
  Narrowing n{program.store};
  to.dt = n.narrowed(from.dt);
  to.step = n.narrowed(from.step);
  to.ahead = n.narrowed(from.ahead);
  to.method = from.method;
  to.integrator = from.integrator;
  to.input_times = from.input_times;
  to.iterations = from.iterations;
  to.velocity_iterations = from.velocity_iterations;
  to.floating = from.floating;
  to.bodies = from.bodies;
  to.joints = from.joints;
  to.velocities = from.velocities;
  to.couplings = from.couplings;
  to.links = from.links;
  to.position_bound = n.narrowed(from.position_bound);
  to.velocity_bound = n.narrowed(from.velocity_bound);
  n.copy(from.gravity, to.gravity);
  n.copy(from.world_gravity, to.world_gravity);
  n.copy(from.root_rotation, to.root_rotation);
  n.copy(from.root_offset, to.root_offset);
  to.body = n.narrowed(from.body);
  to.link = n.narrowed(from.link);
  to.link_mass = n.narrowed(from.link_mass);
  to.joint_row = from.joint_row;
  to.matrix = from.matrix;
  to.solver = from.solver;
  to.armature = n.narrowed(from.armature);
  to.damping = n.narrowed(from.damping);
  to.kp = n.narrowed(from.kp);
  to.kd = n.narrowed(from.kd);
  to.implicit = n.narrowed(from.implicit);
  to.driven = from.driven;
  to.limited = from.limited;
  to.clamped = from.clamped;
  to.effort_limit = n.narrowed(from.effort_limit);
  to.term_start = from.term_start;
  to.term_joint = from.term_joint;
  to.term_gear = from.term_gear;
  to.term_value = n.narrowed(from.term_value);
  to.offset = n.narrowed(from.offset);
  to.softness_first = n.narrowed(from.softness_first);
  to.softness_second = n.narrowed(from.softness_second);
  to.rows = n.narrowed(from.rows);
  to.bounds = n.narrowed(from.bounds);
  to.reduction = n.narrowed(from.reduction);
  to.articulated = from.articulated;
  to.reported = from.reported;
  to.hard_rate = n.narrowed(from.hard_rate);
  to.follows = from.follows;
  to.natural = n.narrowed(from.natural);
  to.natural_row = from.natural_row;
  to.solve_twice = from.solve_twice;
  to.renewed = from.renewed;
  to.free_share = n.narrowed(from.free_share);
  to.per_environment = from.per_environment;
  to.record_impulses = from.record_impulses;
  to.record_diagnostics = from.record_diagnostics;
  program.fits_single = n.all_fit && to.dt > 0.0f;
}

}  // namespace lockstep
