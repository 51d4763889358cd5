// Traces a step: runs the kernels once to decide, and once for each graph. SPDX-License-Identifier: Apache-2.0
#include "trace.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "called_stages.h"
#include "cost.h"
#include "kernels/step.h"
#include "liveness.h"

namespace lockstep::kernels {

using trace::counting;
using trace::tracer;
void first_saturation_pass(Tile<Traced>&) {
  if (!counting) tracer->run("first_saturation_pass(x);\ndo {");
}
void limited_drives(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting) return limited_drives<Traced>(t, batch, x);
  tracer->run("limited_drives(t, batch, x);");
}
bool saturation_differs(const Tables<double>&, const StatePointers<double>&, Tile<Traced>&) {
  if (!counting) tracer->run("} while (saturation_differs(t, batch, x));");
  return false;
}

// bounds_active() records the calls of these two.
void clear_bounds(Tile<Traced>&) {}
void solve_bounds(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting || !tracer->scopes || tracer->learns()) return;
  tracer->aside([&] { tracer->when(x.bounds.candidate.id, false, [&] { solve_by_velocity<Traced>(t, batch, x); }); });
}

namespace {

// Whether the bounds and the guard of a leapfrog step are traced as scopes.
bool traces_stages(const Tables<double>& t) {
  return !counting && tracer->scopes && t.integrator == Integrator::leapfrog &&
         (!t.rounds.used() || trace::traces_bounds(t));
}

// Looks are not reassociated.
template <class Look>
void tracer_aside(Look look) {
  counting ? look() : tracer->aside(look);
}

}  // namespace

// Straight-line code finds out whether a bound may be active, unless other stages read what solve_bounds() leaves in
// memory.
bool bounds_active(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting) {
    if (!t.bounds.always) candidates(t, batch, x);
    return false;
  }
  if (tracer->learns()) {
    tracer->leave_out();
    return false;
  }
  if (tracer->scopes && trace::traces_bounds(t)) {
    tracer->aside([&] { x.bounds.candidate = t.bounds.always ? ~Traced::none() : candidates(t, batch, x); });
    return true;
  }
  if (t.bounds.always || t.record_diagnostics || t.record_impulses) {
    tracer->run("clear_bounds(x);\nif (bounds_active(t, batch, x)) solve_bounds(t, batch, x);", Call::bounds);
    return false;
  }
  Traced::Mask candidate;
  tracer->aside([&] { candidate = candidates(t, batch, x); });
  // Neither solve_bounds() nor what it calls reads these.
  std::set<const void*> unread = {x.dynamics.joint_inertia,
                                  x.dynamics.rhs,
                                  x.dynamics.bias,
                                  x.couplings.acceleration,
                                  x.couplings.velocity_error,
                                  x.couplings.removed_this_step};
  if (t.reduction.used()) unread.insert(x.dynamics.matrix);
  if (t.rounds.from_bodies.count > 0)
    unread.erase(x.dynamics.joint_inertia);
  else if (!t.articulated.used())
    unread.insert({x.bodies.sine, x.bodies.cosine});
  tracer->solve_bounds_if(candidate.id, unread);
  return false;
}

// Without scopes, straight-line code finds the lanes in which bounds act, and a called stage takes the step again in
// these.
void bound_prediction(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x, int time) {
  if (!counting && tracer->learns()) return;
  tracer_aside([&] {
    if (traces_stages(t)) return bound_prediction<Traced>(t, batch, x, time);
    x.bounds.candidate = bounds_act_on_prediction(t, batch, x, time);
  });
}
bool all_bounded(const Tables<double>& t, const Tile<Traced>&) { return traces_stages(t) && t.bounds.always; }
void bound_stages(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x, int time) {
  if (!counting && tracer->learns()) return;
  tracer_aside([&] {
    if (traces_stages(t)) return bound_stages<Traced>(t, batch, x, time);
    x.bounds.candidate = x.bounds.candidate | bounds_act_on_stages(t, batch, x, time);
  });
}
void keep_state(Tile<Traced>&) {
  if (!counting) tracer->keep_state();
}
bool find_contacts(const Tables<double>&, Tile<Traced>&) {
  if (!counting)
    throw SettingsError("contacts", "are solved by the tables, not by generated code",
                        "use Engine::tables or automatic");
  return false;
}
void find_loops(const Tables<double>&, const StatePointers<double>&, Tile<Traced>&) {
  if (!counting)
    throw SettingsError("loops", "are held by the tables, not by generated code", "use Engine::tables or automatic");
}
void changing_shares(const Tables<double>& t, Tile<Traced>& x) {
  if (counting) return changing_shares<Traced>(t, x);
  throw SettingsError("functions of joints and spatial tendons",
                      "are computed by the tables, not by compiled or generated code",
                      "use Engine::tables or automatic");
}
void actuate(const Tables<double>&, const StatePointers<double>&, const Tile<Traced>&) {
  if (!counting)
    throw SettingsError("delays, lags and motors of drives",
                        "are computed by the tables, not by compiled or generated code",
                        "use Engine::tables or automatic");
}
void add_records(const Tables<double>&, Tile<Traced>&) {
  if (!counting)
    throw SettingsError("recorded efforts, contacts or accelerations",
                        "are kept by the tables, not by compiled or generated code", "use Engine::tables or automatic");
}
void find_contacts_at_midpoint(const Tables<double>& t, Tile<Traced>&) {
  if (!counting && t.rounds.at_midpoint)
    throw SettingsError(
        "integrator",
        "leapfrog with contacts, with loops, or with bounds over several velocities, is solved by the tables, not by "
        "generated code",
        "use Engine::tables or automatic");
}
void settle(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting || tracer->learns() || !traces_stages(t)) return;
  tracer->aside([&] { settle<Traced>(t, batch, x); });
}
void judge(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (!counting && tracer->learns()) return;
  tracer_aside([&] {
    if (traces_stages(t)) return judge<Traced>(t, batch, x);
    x.guard.coarse = is_coarse(t, x, squared_coarseness(t, x)) | turns_far(t, x);
  });
}
void audit_if(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting) return;
  if (tracer->learns()) return tracer->leave_out();
  if (tracer->scopes) return tracer->aside([&] { audit_if<Traced>(t, batch, x); });
  const Traced fastest = farthest(x.next.v, t.velocities, farthest(x.state.v, t.velocities, Traced(0.0)));
  tracer->audit_if((beyond(fastest, Traced(t.fast_above)) & ~x.frozen).id);
}
void take_halves(const Tables<double>&, const StatePointers<double>&, Traced::Mask lanes, int depth, Tile<Traced>&) {
  tracer->halves_if(lanes.id, depth);
}
void step_again_if(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting) return;
  if (tracer->learns()) return tracer->leave_out();
  x.too_fast = Traced::none();
  if (traces_stages(t)) {
    if (!t.guarded) return;
    // Beside bounds the code of a half is too long to be fetched for one tile: the tables are as fast.
    if (t.rounds.used() || t.velocities > trace::most_velocities_of_scopes)
      return tracer->halves_if(x.guard.coarse.id, 0);
    return tracer->aside(
        [&] { when(x, x.guard.coarse, [&] { take_halves<Traced>(t, batch, x.guard.coarse, 0, x); }); });
  }
  Traced::Mask lanes = Traced::none();
  if (t.rounds.used()) lanes = lanes | x.bounds.candidate;
  if (t.guarded) lanes = lanes | x.guard.coarse;
  tracer->step_again_if((lanes & ~x.frozen).id);
}

void diagnose(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting) return diagnose<Traced>(t, batch, x);
  tracer->run("diagnose(t, batch, x);", Call::diagnose);
}

void coupling_impulses(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (counting) return coupling_impulses<Traced>(t, batch, x);
  if (t.bounds.rows.count > 0 || t.rounds.servos.count > 0)
    return tracer->run("coupling_impulses(t, batch, x);", Call::coupling_impulses);
  const std::vector<Traced> before(x.couplings.impulse, x.couplings.impulse + t.couplings);
  coupling_impulses<Traced>(t, batch, x);
  // The first tracing runs this stage too, as all tracings must have the same sums. But it drops the results.
  if (tracer->learns()) std::copy(before.begin(), before.end(), x.couplings.impulse);
}

// No result depends on an input such as a force along a fixed axis. A NaN in it is still a fault: the tables' kernels
// multiply it by zero. So it must be a fault here. (A number too large for float is a fault in both precisions.)
void check(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x) {
  if (!counting && !tracer->unused_inputs.empty() && t.velocities > 0) {
    Traced most(0.0), &last = x.next.v[t.velocities - 1];
    for (const trace::Place& place : tracer->unused_inputs)
      most = farther(most, Traced::of(tracer->graph.input(place, false)));
    last = select(beyond(most, Traced(largest_number<float>)), most, last);
  }
  check<Traced>(t, batch, x);
}
void hold_if(const Tables<double>& t, const StatePointers<double>&, Tile<Traced>&, Traced::Mask held,
             Traced::Mask failed) {
  if (!counting) tracer->hold_if(held.id, failed.id, t.turning.count > 0, t.audited);
}

}  // namespace lockstep::kernels

namespace lockstep::trace {

namespace {

// Consistent followers have the positions and velocities that their leaders give them (M76). Only placed ones may be
// known to be so. Then errors of position and velocity become zero, and mirrored joints share the sines of their
// leaders.
void know_consistent_followers(const Tables<double>& t, TracedTile& x, Tracer& tracing) {
  const Reduction<double>& r = t.reduction;
  for (int i = 0; i < r.placing.count; ++i)
    tracing.know(x.state.q[t.term_joint[t.term_start[r.placing[i]]]],
                 -kernels::others_of(t, x, r.placing[i], x.state.q));
  for (int z = 0; z < t.solver.n; ++z) x.dynamics.start[z] = x.state.v[r.independent[z]];
  for (int f = 0; f < r.followers; ++f)
    if (r.placed[f])
      tracing.know(x.state.v[t.velocity_of(r.follower[f])], kernels::followed(t, x, f, x.dynamics.start));
}

// What the first tracing decides for all others.
struct Learned {
  std::vector<std::vector<Term>> terms;
  std::vector<Place> unused_inputs;
};

// Input rows of which the graphs have made nodes, but which no result depends on.
std::vector<Place> unused_inputs_of(const std::vector<const Graph*>& graphs) {
  std::map<std::pair<int, int>, std::pair<Place, bool>> known;
  for (const Graph* graph : graphs) {
    const std::vector<int> used = use_counts(*graph);
    for (Id id = 0; id < static_cast<Id>(used.size()); ++id) {
      const Node& node = graph->nodes()[id];
      if (node.op != Op::input || node.place.array < Access::first_row) continue;
      const auto at = known.try_emplace({node.place.array, node.place.number}, node.place, false).first;
      at->second.second = at->second.second || used[id] > 0;
    }
  }
  std::vector<Place> unused;
  for (const auto& [row, input] : known)
    if (!input.second) unused.push_back(input.first);
  return unused;
}

Learned learned_from(const Tracing& any, const Tracing& consistent) {
  return {terms_of(any, consistent), unused_inputs_of({&any.graph})};
}

// The input rows of one environment. rows(count, name, array) makes each.
template <class MakeRows>
StatePointers<double> inputs(const Tables<double>& t, MakeRows rows) {
  StatePointers<double> batch;
  batch.stride = 1;
  batch.position_target = rows(t.joints * t.input_times, "position_target", Access::position_target);
  batch.velocity_target = rows(t.joints * t.input_times, "velocity_target", Access::velocity_target);
  batch.effort = rows(t.joints * t.input_times, "effort", Access::effort);
  for (int f = 0; f < parameter_count; ++f)
    if (t.declares(static_cast<Parameter>(f)))
      batch.fields[f] = rows(rows_of(t, static_cast<Parameter>(f)), fmt::format("fields[{}]", f), Access::field + f);
  return batch;
}

// Memory for rows. Its blocks do not move.
class Memory {
 public:
  double* take(int count) { return blocks_.emplace_back(static_cast<std::size_t>(count) + 1).data(); }

 private:
  std::vector<std::vector<double>> blocks_;
};

StatePointers<double> traced_inputs(const Tables<double>& t, Tracer& tracing, Memory& memory) {
  return inputs(t, [&](int count, const std::string& name, int array) {
    double* first = memory.take(count);
    tracing.add_rows(first, count, name, array);
    return first;
  });
}

// The tile at the begin of a step.
void begin_tile(const Tables<double>& t, TracedTile& x) {
  x.corrects_positions = x.turned = true;  // as lay_out() has it
  x.consistent = false;
  x.solves_twice = t.solve_twice;

  // advance() computes these once per call. They are known unless each environment has its own.
  if (!t.declares(Parameter::gear_ratio)) kernels::uniform_ratios(t, x);
  if (!t.has_own_inertias()) kernels::uniform_masses(t, x);
}

// Without `learned` this is the first tracing. It leaves out calls, so numbers that only bounds or diagnostics read are
// unused. Therefore they do not influence how sums are added up, and steps round alike with and without them.
Tracing trace_once(const Program& program, bool consistent, bool scopes, const Learned* learned) {
  const Tables<double>& t = program.f64;
  TracedTile x{};
  Tracer tracing(t, x);
  tracing.scopes = scopes;
  Memory memory;
  const StatePointers<double> batch = traced_inputs(t, tracing, memory);

  begin_tile(t, x);
  if (consistent) {
    kernels::no_turns(t, batch, x);
    know_consistent_followers(t, x, tracing);
  }
  if (learned)
    tracing.add_up(learned->terms), tracing.unused_inputs = learned->unused_inputs;
  else
    tracing.learn();
  kernels::step(t, batch, x);
  tracing.keep_state();
  return {tracing.take_graph(), tracing.sums()};
}

}  // namespace

bool traces_bounds(const Tables<double>& t) {
  const int most = t.integrator == Integrator::euler ? most_velocities_of_scopes : most_velocities_of_stages;
  return t.rounds.used() && t.rounds.columns.n <= most && t.method != Method::pgs && t.rounds.slots.count == 0 &&
         t.rounds.from_bodies.count == 0 && !t.record_diagnostics && !t.record_impulses &&
         (t.integrator == Integrator::euler || (t.rounds.in_stages && !t.rounds.at_midpoint && t.input_times == 1));
}

TracedStep trace_step(const Program& program, bool scopes) {
  const Reduction<double>& r = program.f64.reduction;
  const auto once = [&](bool consistent, const Learned* learned) {
    return trace_once(program, consistent, scopes, learned);
  };
  const Tracing any = once(false, nullptr);
  // Diagnostics rule out the shorter step, but may not change the result by a bit. So this does not depend on them.
  const Learned learned = r.placing.count > 0 ? learned_from(any, once(true, nullptr)) : learned_from(any, any);
  TracedStep step{once(false, &learned).graph, {}};
  if (r.consistent_is_shorter) step.consistent = once(true, &learned).graph;
  return step;
}

namespace {

using kernels::Routine;

// Whether the routine takes no decision, and a step of the plan runs it.
bool applies(const Tables<double>& t, Routine routine) {
  if (routine == Routine::begin_round)
    for (int i = 0; i < t.rounds.servos.count; ++i)
      if (t.rounds.servos[i].follower >= 0) return false;  // its corrections are those of one phase
  const bool euler = t.integrator == Integrator::euler;
  switch (routine) {
    case Routine::begin_round:
    case Routine::solve_round: return t.rounds.used();
    case Routine::midpoint:
    case Routine::prediction:
    case Routine::end: return !euler;
    case Routine::bias:
    case Routine::stages: return !euler && !t.loops.used();
    case Routine::forces: return euler && !t.guesses_servos();
    case Routine::momenta: return euler && t.rows.count == 0;
    case Routine::free_step: return euler && (t.rows.count > 0 || !(t.rounds.used() && t.solves_first()));
    default: return euler;
  }
}

void run_routine(const Tables<double>& t, const StatePointers<double>& batch, Routine routine, TracedTile& x) {
  const Tables<double>& solve = t.midpoint ? *t.midpoint : t;
  switch (routine) {
    case Routine::kinematics: return kernels::kinematics(t, x);
    case Routine::forces: return kernels::forces(t, batch, x);
    case Routine::momenta: return kernels::momenta(t, x);
    case Routine::free_step: return kernels::free_step(t, batch, x);
    case Routine::midpoint: return kernels::move_to_midpoint(t, x);
    case Routine::prediction: return kernels::predict(t, batch, x, 0);
    case Routine::bias: return kernels::bias_of_stages(t, batch, x);
    case Routine::stages: return kernels::take_stages(t, batch, x, 0);
    case Routine::end: return kernels::move_to_end(t, x);
    case Routine::begin_round: kernels::begin_servos(solve, x); return kernels::begin_round(solve, batch, x);
    case Routine::solve_round: return kernels::solve_round(solve, x);
    case Routine::count: return;
  }
}

}  // namespace

bool takes_routines(const Tables<double>& t) {
  const bool renews = t.actuators.used() || t.shares_change();  // what is traced as the same in all steps of a call
  return (t.contacts.used() || t.loops.used() || t.rounds.at_midpoint) && !renews &&
         (t.integrator == Integrator::euler || t.midpoint);
}

TracedRoutines trace_routines(const Program& program) {
  const Tables<double>& t = program.f64;
  TracedRoutines all;
  std::vector<const Graph*> graphs;
  for (int i = 0; i < kernels::routine_count; ++i) {
    const auto routine = static_cast<Routine>(i);
    if (!applies(t, routine)) continue;
    TracedTile x{};
    Tracer tracing(t, x, true);
    Memory memory;
    const StatePointers<double> batch = traced_inputs(t, tracing, memory);
    begin_tile(t, x);
    tracing.aside([&] { run_routine(t, batch, routine, x); });
    tracing.end_routine();
    graphs.push_back(&all.graph[static_cast<std::size_t>(i)].emplace(tracing.take_graph()));
  }
  all.unread = unused_inputs_of(graphs);
  return all;
}

Cost cost_of(const Program& program) {
  const Tables<double>& t = program.f64;
  TracedTile x{};
  std::vector<std::byte> scratch(kernels::lay_out(t, nullptr, x) + 64);
  kernels::lay_out(t, scratch.data(), x);
  Memory memory;
  const StatePointers<double> batch = inputs(t, [&](int count, const std::string&, int) { return memory.take(count); });
  Cost cost;
  counting = &cost;
  kernels::uniform_masses(t, x);
  kernels::uniform_ratios(t, x);
  cost = {};  // the two above run once for all environments
  if (t.declares(Parameter::gear_ratio)) kernels::own_ratios(t, batch, x);
  if (t.declares(Parameter::offset)) kernels::own_offsets(t, batch, x);
  if (t.has_own_inertias()) {
    kernels::own_inertias(t, batch, x);
    kernels::move_masses_inwards(t, x);
  }
  kernels::step(t, batch, x);
  counting = nullptr;
  return cost;
}

}  // namespace lockstep::trace
