// The tables in single precision. SPDX-License-Identifier: Apache-2.0
#include "layout.h"

namespace lockstep {
namespace {

float narrowed(double value) { return static_cast<float>(value); }

template <int N>
void copy(const double (&from)[N], float (&to)[N]) {
  for (int i = 0; i < N; ++i) to[i] = narrowed(from[i]);
}

Body<float> narrowed(const Body<double>& from) {
  Body<float> to{from.parent, from.axis, from.prismatic, from.rotated, from.root, narrowed(from.sign), {}, {},
                 narrowed(from.mass), {}, {}};
  copy(from.rotation, to.rotation);
  copy(from.offset, to.offset);
  copy(from.moment, to.moment);
  copy(from.second, to.second);
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
auto narrowed(Span<E> from, Store& store) {
  std::vector<decltype(narrowed(from[0]))> to;
  for (int i = 0; i < from.count; ++i) to.push_back(narrowed(from[i]));
  return store.keep(std::move(to));
}

Rows<float> narrowed(const Rows<double>& from, Store& store) {
  return {from.count, from.coupling, from.term_start, from.term_index, narrowed(from.term_value, store),
          from.contribution_start, from.contribution, from.support_start, from.support, from.run_start, from.runs, from.pairs,
          from.neighbour_start, from.neighbours, from.response_entries, from.columns, narrowed(from.softness, store)};
}

Reduction<float> narrowed(const Reduction<double>& from, Store& store) {
  return {from.followers, from.follower, from.follower_of, from.independent, from.start, from.column, narrowed(from.value, store),
          from.inverse_start, from.inverse_coupling, narrowed(from.inverse_value, store), narrowed(from.rate, store),
          from.product_start, from.product_source, narrowed(from.product_value, store), from.product_left,
          from.product_right, from.entries, narrowed(from.fills, store), narrowed(from.eliminations, store),
          narrowed(from.updates, store), from.pivot, from.value_entry, from.inverse_entry};
}

}  // namespace

void narrow(Program& program) {
  const Tables<double>& from = program.f64;
  Tables<float>& to = program.f32;
  Store& store = program.store;
  to.dt = narrowed(from.dt);
  to.method = from.method;
  to.iterations = from.iterations;
  to.velocity_iterations = from.velocity_iterations;
  to.floating = from.floating;
  to.bodies = from.bodies;
  to.joints = from.joints;
  to.velocities = from.velocities;
  to.couplings = from.couplings;
  to.links = from.links;
  to.position_bound = narrowed(from.position_bound);
  to.velocity_bound = narrowed(from.velocity_bound);
  copy(from.gravity, to.gravity);
  copy(from.world_gravity, to.world_gravity);
  copy(from.root_rotation, to.root_rotation);
  copy(from.root_offset, to.root_offset);
  to.body = narrowed(from.body, store);
  to.link = narrowed(from.link, store);
  to.link_mass = narrowed(from.link_mass, store);
  to.joint_row = from.joint_row;
  to.matrix = from.matrix;
  to.solver = from.solver;
  to.armature = narrowed(from.armature, store);
  to.damping = narrowed(from.damping, store);
  to.kp = narrowed(from.kp, store);
  to.kd = narrowed(from.kd, store);
  to.implicit = narrowed(from.implicit, store);
  to.driven = from.driven;
  to.term_start = from.term_start;
  to.term_joint = from.term_joint;
  to.term_gear = from.term_gear;
  to.term_value = narrowed(from.term_value, store);
  to.offset = narrowed(from.offset, store);
  to.softness_first = narrowed(from.softness_first, store);
  to.softness_second = narrowed(from.softness_second, store);
  to.rows = narrowed(from.rows, store);
  to.reduction = narrowed(from.reduction, store);
  to.natural = narrowed(from.natural, store);
  to.natural_row = from.natural_row;
  to.solve_twice = from.solve_twice;
  to.renewed = from.renewed;
  to.free_share = narrowed(from.free_share);
  to.per_environment = from.per_environment;
  to.record_impulses = from.record_impulses;
}

}  // namespace lockstep
