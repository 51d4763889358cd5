// Contacts, and bounds that stages cannot hold, in a leapfrog step. SPDX-License-Identifier: Apache-2.0
//
// Section 28. From midpoint to midpoint a leapfrog is semi-implicit Euler. So contacts are found at the midpoint, and
// lanes in which they act are solved there by the rounds of euler, for the velocities that lead to the next midpoint.
// Bounds of lanes in which no contact acts stay in the stages, unless some are rows over several velocities. A lane in
// which nothing acts keeps the step that the stages have made, to the last bit.
#pragma once

#include "kernels/loops/find_loops.h"
#include "leapfrog_bounds.h"
#include "solve_contacts.h"

namespace lockstep::kernels {

constexpr double most_explicit = 16.0;  // (M121)

/// What is linear in the speed and in the position of joint j: damping and stiffness.
template <class T>
struct LinearTerms {
  T damping, stiffness;
  LOCKSTEP_INLINE T inertia(T time) const { return time * fma(time, stiffness, damping); }
};

/// act(joint, its linear terms in the stages, those in the matrix of the midpoint). Servos with an effort limit are not
/// among the last: the rounds have them.
template <class T, class Act>
void each_implicit(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Act&& act) {
  const Rounds& rounds = t.rounds;
  const Span<int> all = t.servos, linear = t.midpoint->servos;
  int a = 0, b = 0;
  for (int i = 0; i < rounds.implicit.count; ++i) {
    const ImplicitJoint& joint = rounds.implicit[i];
    const T damping = field<T>(batch, Parameter::damping, t.damping.data).at(joint.joint, t.dof[joint.joint]);
    LinearTerms<T> of_stage{damping, stiffness<T>(t, batch, joint.joint)}, of_midpoint = of_stage;
    const auto add = [&](LinearTerms<T>& terms) LOCKSTEP_INLINED {
      const Gains<T> own = gains<T>(t, batch, joint.joint);
      terms.damping += own.kd, terms.stiffness += own.kp;
    };
    while (a < all.count && all[a] < joint.joint) ++a;
    while (b < linear.count && linear[b] < joint.joint) ++b;
    if (a < all.count && all[a] == joint.joint) add(of_stage);
    if (b < linear.count && linear[b] == joint.joint) add(of_midpoint);
    act(joint, of_stage, of_midpoint);
  }
}

/// (M121), (M122): the matrix, in x.held.matrix, from that of the stages.
template <class T>
void matrix_at_midpoint(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Rounds& rounds = t.rounds;
  const Columns& columns = rounds.columns;
  const T ahead = T(t.ahead), h = T(t.step), half = T(S(0.5)) * h;
  const auto share_of = [&](const ImplicitTerm& term)
                            LOCKSTEP_INLINED { return term.share < 0 ? T(1) : x.couplings.share[term.share]; };

  // By velocity: the diagonal of the stages, and what of it is implicit.
  for (int k = 0; k < columns.n; ++k) {
    x.held.matrix[columns.offset[k]] = x.midpoint.diagonal[k];
    x.midpoint.implicit[k] = T(0);
  }
  each_implicit<T>(t, batch, [&](const ImplicitJoint& joint, const LinearTerms<T>& stage, const LinearTerms<T>&) {
    for (int i = joint.first; i < joint.last; ++i) {
      const T share = share_of(rounds.implicit_term[i]);
      T& sum = x.midpoint.implicit[rounds.implicit_term[i].velocity];
      sum = fma(share * share, stage.inertia(ahead), sum);
    }
  });

  // By joint: kappa (M121), and its terms (M122) in place of the stages'.
  for (int j = 0; j < t.joints; ++j) x.midpoint.halved[j] = ~T::none();
  each_implicit<T>(t, batch, [&](const ImplicitJoint& joint, const LinearTerms<T>& stage, const LinearTerms<T>& own) {
    T response = T(0);  // of the joint, without its linear terms and those beside it
    for (int i = joint.first; i < joint.last; ++i) {
      const ImplicitTerm& term = rounds.implicit_term[i];
      const T share = share_of(term), inertia = x.midpoint.diagonal[term.velocity] - x.midpoint.implicit[term.velocity];
      response = fma(share * share, T(1) / larger(inertia, T(S(1e-30))), response);
    }
    const auto halved = less(stage.inertia(h) * response, T(S(most_explicit)));
    x.midpoint.halved[joint.joint] = halved;
    const T more = select(halved, own.inertia(half), own.inertia(h)) - stage.inertia(ahead);
    const int* entry = rounds.implicit_entry.data + joint.entry;
    for (int i = joint.first; i < joint.last; ++i)
      for (int l = joint.first; l <= i; ++l, ++entry)
        x.held.matrix[*entry] =
            fma(share_of(rounds.implicit_term[i]) * share_of(rounds.implicit_term[l]), more, x.held.matrix[*entry]);
  });
}

/// (M67) in lanes where something holds what the stages move freely: the bias forces at the velocities `middle` of the
/// solver, in place of those of the stages' prediction.
template <class T>
void predict_bias(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes,
                  const T* middle, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T twice_gamma = T(S(2) * Alexander<S>::gamma);
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];
  expand(t, x, middle, x.state.v, [](int, T following) LOCKSTEP_INLINED { return following; });
  T* const before = x.midpoint.before;
  for (int k = 0; k < t.velocities; ++k) {
    before[k] = x.dynamics.bias[k];
    if (t.guarded)
      x.guard.change[k] = select(lanes, twice_gamma * (x.state.v[k] - x.stages.midpoint.v[k]), x.guard.change[k]);
  }
  bias_forces(t, batch, x);
  if (t.loops.used()) {
    move_bodies(t, x, x.loops.motion);
    loop_bias(t, x.loops.motion, lanes, x);
  }
  for (int k = 0; k < t.velocities; ++k) x.dynamics.bias[k] = select(lanes, x.dynamics.bias[k], before[k]);
  x.midpoint.predicted = x.midpoint.predicted | lanes;
}

/// The same where contacts go on: with the impulses that they had in the step before.
template <class T>
void predict_with_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const auto lanes = x.contacts.goes_on & ~x.frozen;
  if (!any(lanes)) return;
  each_slot(t, x, [&](const auto& pair, const ContactPatch<T>&, ContactSlot<T>& slot) LOCKSTEP_INLINED {
    const T impulse[3] = {slot.pressed, slot.carried[0], slot.carried[1]};
    for (int i = 0; i < 3; ++i) slot.force.impulse[i] = select(slot.goes_on, impulse[i], T(0));
    slot.force.sticks = slot.goes_on;
    if (TurningFriction<T>* const turning = turning_of(pair, slot, x))
      turning->force.impulse = select<T>(slot.goes_on, turning->carried, Vec3<T>::zero());
  });
  momentum_of_contacts(t, x.rounds.momentum, x);
  x.dynamics.half_solved_velocity = x.dynamics.half_solved_position;
  from_rounds(t, x.rounds.momentum, x.dynamics.half_solved_position);
  half_solve(t, x);
  T* const middle = x.midpoint.way;
  for (int z = 0; z < t.solver.n; ++z) middle[z] = x.dynamics.half_solved_position[z];
  solve_downwards(t, x, middle, static_cast<T*>(nullptr));
  const T half = T(S(0.5)), share = T(S(0.5) / Alexander<S>::gamma);
  for (int z = 0; z < t.solver.n; ++z) {
    const int k = t.reduction.velocity_of(z);
    middle[z] = fma(half, middle[z], fma(share, x.midpoint.change[k], x.stages.midpoint.v[k]));
  }
  predict_bias(t, batch, lanes, middle, x);
}

/// Back to the prediction of the stages, in lanes that keep these.
template <class T>
void return_to_stages(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  for (int k = 0; k < t.velocities; ++k) {
    x.dynamics.bias[k] = select(lanes, x.midpoint.bias[k], x.dynamics.bias[k]);
    if (t.guarded) x.guard.change[k] = select(lanes, x.midpoint.change[k], x.guard.change[k]);
  }
  x.midpoint.predicted = x.midpoint.predicted & ~lanes;
}

/// The momenta of the rounds at the midpoint, with the present bias forces.
template <class T>
void momenta_at_midpoint(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  const Tables<ScalarOf<T>>& solve = *t.midpoint;
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];
  for (int k = 0; k < t.velocities; ++k) x.state.v[k] = x.stages.midpoint.v[k];
  x.corrects_positions = true;
  x.solves_twice = t.solve_twice;
  if (t.couplings > 0) coupling_errors(t, x);
  if (t.reduction.followers > 0) follow(solve, x);
  joint_forces(solve, batch, x, time);
  share_momenta(solve, x);
  momenta_to_gain(solve, x);
  keep_momentum(solve, x);
  for (int r = 0; r < t.rows.count; ++r) {
    x.rows.error[r] = x.couplings.error[t.rows.coupling[r]];
    x.rows.bias[r] = x.midpoint.rate[r] * x.rows.error[r];
  }
}

/// (M123): the solutions as the velocities that end the step, in these lanes. Where all that presses bounces, the share
/// `landing` of the step is made before and the rest after (M128); elsewhere it is above 1. A joint that was within its
/// range stays there.
template <class T>
void close_midpoint(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes,
                    T landing, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T half = T(S(0.5)), per_step = T(S(1) / t.step);
  const int n = t.solver.n;
  const T* const first = x.dynamics.solution;
  const T* const second = x.solves_twice ? x.dynamics.velocity_solution : first;
  T* const mean = x.rounds.kept;

  // The mean velocity: of (M123), or of a flight (M128).
  for (int z = 0; z < n; ++z) mean[z] = fma(half, x.dynamics.start[z] - second[z], first[z]);
  if (const auto flies = lanes & ~less(T(1), landing); any(flies))
    for (int z = 0; z < n; ++z) {
      const T start = x.dynamics.start[z], left = T(1) - landing;
      const T gain = half * (x.next.v[t.reduction.velocity_of(z)] - start);
      const T way = fma(landing, fma(landing, gain, start), left * fnma(left, gain, second[z]));
      mean[z] = select(flies, way, mean[z]);
    }

  // Joints that began within their range end within it.
  for (int i = 0; i < t.bounds.watched.count; ++i) {
    const int j = t.bounds.watched[i].joint;
    if (!t.bounds.watched[i].ranged || !(t.bounds.has[j] & has_range)) continue;
    const Interval<T> range = position_limits<T>(t, batch, j);
    const T began = x.stages.begin.q[j];
    for (int z = 0; z < n; ++z) {
      if (t.reduction.velocity_of(z) != t.velocity_of(j)) continue;
      const T lo = select(less(began, range.lo), mean[z], (range.lo - began) * per_step),
              hi = select(less(range.hi, began), mean[z], (range.hi - began) * per_step);
      mean[z] = clamp(mean[z], lo, hi);
    }
  }

  // All velocities, in these lanes.
  const T* const error = x.couplings.velocity_error;
  expand(t, x, mean, x.dynamics.scratch, [&](int f, T following) LOCKSTEP_INLINED {
    return fma(half, error[f], following + x.couplings.correction[f]);
  });
  for (int k = 0; k < t.velocities; ++k)
    x.stages.mean_velocity[k] = select(lanes, x.dynamics.scratch[k], x.stages.mean_velocity[k]);
  expand(t, x, second, x.dynamics.scratch, [](int, T following) LOCKSTEP_INLINED { return following; });
  for (int k = 0; k < t.velocities; ++k) x.next.v[k] = select(lanes, x.dynamics.scratch[k], x.next.v[k]);
}

/// Solves the bounds that stages cannot hold. A lane in which none acts keeps its step, unless the stages have
/// `violated` some. Returns the others.
template <class T>
typename T::Mask solve_rows_at_midpoint(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                        typename T::Mask open, typename T::Mask violated, int time, Tile<T>& x) {
  const Tables<ScalarOf<T>>& solve = *t.midpoint;
  begin_rounds(solve, batch, x);
  x.bounds.invalid = x.bounds.invalid & open;
  open = open & ~x.bounds.invalid;
  exchange_softness(t, x);
  const T unfinished = x.contacts.unfinished;
  solve_rows(solve, batch, open, x);
  if (const auto free = open & ~x.midpoint.predicted; any(free)) {  // once more, with the bias forces in its middle
    const T* const second = t.solve_twice ? x.dynamics.velocity_solution : x.dynamics.solution;
    T* const middle = x.midpoint.way;
    for (int z = 0; z < t.solver.n; ++z) middle[z] = T(ScalarOf<T>(0.5)) * (x.dynamics.start[z] + second[z]);
    predict_bias(t, batch, free, middle, x);
    exchange_softness(t, x);
    momenta_at_midpoint(t, batch, x, time);
    exchange_softness(t, x);
    x.contacts.unfinished = unfinished;
    solve_rows(solve, batch, open, x);
  }
  exchange_softness(t, x);
  x.singular = x.singular | (x.rounds.weak & open);
  auto acts = list_active_rows_of(solve, open, x) | (violated & open);
  // The stages have servos without limits, and no loops.
  if (t.row_servos.count > 0 || t.loops.used()) acts = acts | open;
  for (int i = 0; i < t.limited_servos.count; ++i) acts = acts | (beyond(x.servos.saturation[i], T(0)) & open);
  close_midpoint(t, batch, acts, never<T>(), x);
  mark_invalid(t, x);
  return acts;
}

/// (M120): lanes in which some slot acts on the way to the step's end or to the next midpoint.
template <class T>
typename T::Mask acts_on_way(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  auto acting = T::none();
  each_near(t, x, [&](const auto& pair, const ContactPatch<T>& patch, const LiveSlots<T>& slots) LOCKSTEP_INLINED {
    const T* const ways[] = {x.midpoint.way, x.midpoint.end};
    for (const T* const z : ways) {
      const RelativeTwist<T> twist = twist_of(t, pair, x, z);
      for (ContactSlot<T>& slot : slots) {
        slot_speed(slot, twist, slot.speed);
        TurningFriction<T>* const turning = turning_of(pair, slot, x);
        const Vec3<T> turns = turning ? by_radii(pair, twist.turning) : Vec3<T>::zero();
        contact_force(slot, turning, patch.friction, slot.speed, turns, slot.trial,
                      turning ? &turning->trial : nullptr);
        acting = acting | ((slot.trial.sticks | slot.trial.slides) & ~slot.bounces);
      }
    }
  });
  return acting;
}

/// Solves the contacts in lanes where one acts. A lane in which all let go keeps its step. Returns the others.
template <class T>
typename T::Mask solve_contacts_at_midpoint(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                            Tile<T>& x) {
  using S = ScalarOf<T>;
  const Tables<S>& solve = *t.midpoint;
  const T half = T(S(0.5));

  // The velocities of (M120).
  for (int z = 0; z < t.solver.n; ++z) {
    const int k = t.reduction.velocity_of(z), place = t.rounds.place[z];
    x.rounds.z[place] = x.next.v[k];
    x.midpoint.end[place] = fnma(half, x.stages.midpoint.v[k], x.stages.mean_velocity[k]);
    x.midpoint.way[place] = fma(half, x.next.v[k], x.midpoint.end[place]);
  }

  // Lanes in which a contact acts at one of them, or goes on.
  auto free = open_contacts(solve, batch, x.rounds.z, true, x);
  free = (free | acts_on_way(solve, x)) & ~x.singular & ~x.frozen;
  const auto acting = (free | x.contacts.held) & ~x.singular & ~x.frozen;
  if (!any(acting)) {
    remember(solve, T::none(), x);
    return acting;
  }

  // Euler's solves, with the whole step.
  const auto invalid = x.bounds.invalid;
  begin_rounds(solve, batch, x);
  exchange_softness(t, x);
  solve_contacts(solve, batch, acting, x);
  exchange_softness(t, x);

  // Lanes that take the result. If all that presses bounces, the first landing counts (M128).
  auto presses = free, others = T::none();
  T landing = never<T>();
  for (int s = 0; s < t.contacts.slots; ++s) {
    const ContactSlot<T>& slot = x.contacts.slot[s];
    const auto pressed = less(T(0), slot.pressed) & acting;
    presses = presses | pressed, others = others | (pressed & ~slot.bounces);
    landing = select(pressed & slot.bounces, smaller(landing, slot.landing), landing);
  }
  landing = select(others, never<T>(), landing);

  x.singular = x.singular | (x.rounds.weak & presses);
  list_active_rows_of(solve, presses, x);
  x.bounds.invalid = (x.bounds.invalid & presses) | (invalid & ~presses);
  close_midpoint(t, batch, presses, landing, x);
  if (t.bounds.rows.count > 0) mark_invalid(t, x);
  return presses;
}

/// After the kinematics of the midpoint: finds contacts there.
template <class T>
void find_contacts_at_midpoint(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  if (!t.contacts.used()) return;
  if (t.guarded) scale_memory(t, x);
  turn_start(t, x);
  const auto held = collide(*t.midpoint, x);
  x.contacts.goes_on = held;
  x.contacts.held = t.contacts.bounces ? T::none() : held;
}

/// After the stages: takes the step again from the midpoint in lanes where something acts that the stages do not hold.
template <class T>
void step_from_midpoint(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  if (!t.rounds.at_midpoint) return;
  if (!t.rounds.in_stages) x.stage_bounds.opened = T::none();
  x.bounds.invalid = x.bounds.invalid & x.stage_bounds.opened;
  auto rows = T::none(), violated = T::none(), acts = T::none();
  if (t.loops.used()) {
    rows = ~x.frozen;
  } else if (!t.rounds.in_stages && t.bounds.rows.count + t.limited_servos.count > 0) {
    violated = violated_by_stages(t, batch, x, time) & ~x.frozen;
    rows = (t.bounds.always ? ~T::none() : violated | bounds_act_on_prediction(t, batch, x, time)) & ~x.frozen;
  }
  const bool near = x.contacts.near_count > 0;
  x.midpoint.predicted = T::none();
  if (any(rows) || near) {
    for (int k = 0; k < t.velocities; ++k) x.midpoint.bias[k] = x.dynamics.bias[k];
    if (near && !t.loops.used()) predict_with_contacts(t, batch, x);
    // What the stages let go where bounds hold it says nothing of bias forces.
    if (const auto unknown = rows & ~x.midpoint.predicted; any(unknown))
      for (int k = 0; k < t.velocities; ++k)
        x.dynamics.bias[k] = select(unknown, x.midpoint.first_bias[k], x.dynamics.bias[k]);
    matrix_at_midpoint(t, batch, x);
    momenta_at_midpoint(t, batch, x, time);
    x.bounds.active_count = 0;
    if (any(rows)) acts = solve_rows_at_midpoint(t, batch, rows, violated, time, x);
    if (near) acts = acts | solve_contacts_at_midpoint(t, batch, x);
    return_to_stages(t, ~acts, x);
  }
  x.midpoint.acts = acts;
  if (t.contacts.used() && !near) remember(*t.midpoint, T::none(), x);
}

/// At the end of the step, when roots have their axes: what the next step is to know of this one's start.
template <class T>
void remember_midpoint(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  if (!t.contacts.used()) return;
  for (int z = 0; z < t.solver.n; ++z) {
    const int k = t.reduction.velocity_of(z);
    x.midpoint.way[t.rounds.place[z]] = x.stages.midpoint.v[k];
  }
  remember_start(t, x.midpoint.way, x);
  turn_start(t, x);
  x.contacts.length = select(x.frozen, x.contacts.length, T(t.step));
}

/// What the guard takes back where it takes a step again: act(number).
template <class T, class Act>
void each_of_contacts(const Tables<ScalarOf<T>>& t, Tile<T>& x, Act&& act) {
  each_remembered(t, x, act);
  const auto act_on_lanes = [&](typename T::Mask& lanes) LOCKSTEP_INLINED {
    T number = select(lanes, T(1), T(0));
    act(number);
    lanes = less(T(0), number);
  };
  act_on_lanes(x.contacts.kept), act_on_lanes(x.contacts.known);
  act(x.contacts.unfinished), act(x.contacts.work);
}
template <class T>
void copy_contacts(const Tables<ScalarOf<T>>& t, Tile<T>& x, T* to) {
  if (t.contacts.used()) each_of_contacts(t, x, [&](const T& number) LOCKSTEP_INLINED { *to++ = number; });
}
/// In lanes of `open`, back to what has been copied.
template <class T>
void restore_contacts(const Tables<ScalarOf<T>>& t, typename T::Mask open, const T* from, Tile<T>& x) {
  if (!t.contacts.used()) return;
  each_of_contacts(t, x, [&](T& number) LOCKSTEP_INLINED { number = select(open, *from++, number); });
}

}  // namespace lockstep::kernels
