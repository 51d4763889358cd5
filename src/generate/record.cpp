#include "record.h"

#include <fmt/format.h>

#include <set>

#include "../kernels/gear_ratios.h"
#include "recorder.h"
#include "uses.h"

// Stages that look at what is in the lanes before they know what to do have no straight-line code: generated code
// calls them as the tables do. Declared before step.h, which finds them in place of its own.
namespace lockstep::kernels {

using generate::Recorded;
using generate::recorder;

inline void first_pass(Tile<Recorded>&) { recorder->run("first_pass(x);\ndo {"); }
inline void limited_drives(const Tables<double>&, const Lanes<double>&, Tile<Recorded>&) {
  recorder->run("limited_drives(t, lanes, x);");
}
inline bool saturation_differs(const Tables<double>&, const Lanes<double>&, Tile<Recorded>&) {
  recorder->run("} while (saturation_differs(t, lanes, x));");
  return false;
}
inline void forget_bounds(Tile<Recorded>&) {}  // in the line below
inline bool bounds_act(const Tables<double>& t, Tile<Recorded>& x);
inline void compete(const Tables<double>&, const Lanes<double>&, Tile<Recorded>&) {}  // in the line above
inline void diagnose(const Tables<double>&, const Lanes<double>&, Tile<Recorded>&) {
  recorder->run("diagnose(t, lanes, x);", Call::diagnose);
}
inline void hold_frozen(const Tables<double>&, const Lanes<double>&, Tile<Recorded>& x, Recorded::Mask failed) {
  recorder->hold_if(x.frozen.id, failed.id);
}
inline void coupling_impulses(const Tables<double>& t, Tile<Recorded>& x);

template <int N, class Turn>
void repeat(int times, const Tile<Recorded>&, Recorded* const (&handed)[N], int length, Turn&& turn) {
  if (times < 2) {
    for (int i = 0; i < times; ++i) turn();
    return;
  }
  const auto gather = [&] {
    std::vector<generate::Id> all;
    for (Recorded* array : handed)
      for (int i = 0; i < length; ++i) all.push_back(array[i].id);
    return all;
  };
  const auto spread = [&](const std::vector<generate::Id>& all) {
    for (int a = 0; a < N; ++a)
      for (int i = 0; i < length; ++i) handed[a][i] = Recorded::of(all[a * length + i]);
  };
  spread(recorder->graph.begin_loop(times, gather()));
  turn();
  spread(recorder->graph.end_loop(gather()));
}

}  // namespace lockstep::kernels

#include "../kernels/step.h"

namespace lockstep::kernels {

// Idle bounds are looked for in the straight line, unless others look at what compete() leaves in memory.
inline bool bounds_act(const Tables<double>& t, Tile<Recorded>& x) {
  if (recorder->learns()) {
    recorder->leave_out();
    return false;
  }
  if (t.bounds.always || t.record_diagnostics || t.record_impulses) {
    recorder->run("forget_bounds(x);\nif (bounds_act(t, x)) compete(t, lanes, x);", Call::compete);
    return false;
  }
  Recorded::Mask suspect;
  recorder->aside([&] { suspect = suspects(t, x); });
  // Neither compete() nor what it calls has a use for these.
  std::set<std::string> unread = {"joint_inertia", "drive", "bias", "acceleration", "mismatch", "lost"};
  if (t.reduction.followers > 0) unread.insert("matrix");
  if (!t.articulated.used()) unread.insert({"sine", "cosine"});
  recorder->compete_if(suspect.id, unread);
  return false;
}

inline void coupling_impulses(const Tables<double>& t, Tile<Recorded>& x) {
  if (t.bounds.form.count > 0) return recorder->run("coupling_impulses(t, x);", Call::coupling_impulses);
  const std::vector<Recorded> before(x.impulse, x.impulse + t.couplings);  // all recordings count the same sums
  coupling_impulses<Recorded>(t, x);
  if (recorder->learns()) std::copy(before.begin(), before.end(), x.impulse);
}

// What is no number in an input that no result depends on - a force along a fixed axis - is a fault by the tables, where
// it is multiplied by nothing; so it is here. (What no float holds is none in either precision.)
inline void check(const Tables<double>& t, const Lanes<double>& lanes, Tile<Recorded>& x) {
  if (!recorder->idle.empty() && t.velocities > 0) {
    Recorded most(0.0), &last = x.next_v[t.velocities - 1];
    for (const generate::Place& place : recorder->idle) most = farther(most, Recorded::of(recorder->graph.input(place, false)));
    last = select(beyond(most, Recorded(largest_number<float>)), most, last);
  }
  check<Recorded>(t, lanes, x);
}

}  // namespace lockstep::kernels

namespace lockstep::generate {

namespace {

// In place, followers' positions and velocities are what they follow (M76): errors and what they are off by come out as
// nothing, sines of mirrored joints as those of their drivers.
void know_followers(const Tables<double>& t, RecordedTile& x, Recorder& recording) {
  const Reduction<double>& r = t.reduction;
  for (int i = 0; i < r.placing.count; ++i)
    recording.know(x.q[t.term_joint[t.term_start[r.placing[i]]]], -kernels::others_of(t, x, r.placing[i], x.q));
  for (int z = 0; z < t.solver.n; ++z) x.start[z] = x.v[r.independent[z]];
  for (int f = 0; f < r.followers; ++f)
    recording.know(x.v[t.velocities - t.joints + r.follower[f]], kernels::followed(t, x, f, x.start));
}

struct Learned {
  std::vector<std::vector<Term>> terms;
  std::vector<Place> idle;
};

Learned learned_from(const Recording& any, const Recording& in_place) {
  const std::vector<int> used = uses(any.graph);
  std::vector<Place> idle;
  for (Id id = 0; id < static_cast<Id>(used.size()); ++id) {
    const Node& node = any.graph.nodes()[id];
    if (node.op == Op::input && node.place.array >= Access::first_row && used[id] == 0) idle.push_back(node.place);
  }
  return {terms_of(any, in_place), std::move(idle)};
}

// Without anything `learned` it learns. Numbers that only bounds or diagnostics read are unused then, so that they do not
// decide how sums are added up, and steps round alike with them and without.
Recording record_once(const Program& program, bool in_place, const Learned* learned) {
  const Tables<double>& t = program.f64;
  Lanes<double> lanes;
  lanes.stride = 1;
  RecordedTile x{};
  Recorder recording(t, x);
  std::vector<std::vector<double>> blocks;
  const auto rows = [&](int count, const std::string& name, int array) {
    double* first = blocks.emplace_back(static_cast<std::size_t>(count) + 1).data();
    recording.add_rows(first, count, name, array);
    return first;
  };
  lanes.position_target = rows(t.joints * t.input_times, "position_target", Access::position_target);
  lanes.velocity_target = rows(t.joints * t.input_times, "velocity_target", Access::velocity_target);
  lanes.effort = rows(t.joints * t.input_times, "effort", Access::effort);
  const int field_rows[parameter_count] = {t.term_gear.count, t.couplings, 2 * t.couplings, 2 * t.joints,
                                           t.joints, t.links, 3, 6 * t.links, t.couplings};
  for (int f = 0; f < parameter_count; ++f)
    if ((t.per_environment >> f) & 1u) lanes.field[f] = rows(field_rows[f], fmt::format("field[{}]", f), Access::field + f);

  x.corrects = true;  // as lay_out() has it
  x.in_place = false;
  x.solves_twice = t.solve_twice;

  // What advance() makes once per call: known numbers, unless each environment has its own.
  if (!kernels::declared<Recorded>(t, 0)) kernels::uniform_ratios(t, x);
  if (!kernels::declared<Recorded>(t, 5)) kernels::uniform_masses(t, x);
  if (in_place) know_followers(t, x, recording);
  if (learned)
    recording.add_up(learned->terms), recording.idle = learned->idle;
  else
    recording.learn();
  kernels::step(t, lanes, x);
  recording.finish();
  return {std::move(recording.graph), recording.sums()};
}

}  // namespace

RecordedStep record_step(const Program& program) {
  const Reduction<double>& r = program.f64.reduction;
  const Recording any = record_once(program, false, nullptr);
  // Also where diagnostics, which are not to change a bit, keep steps from being shorter in place.
  const Learned learned =
      r.placing.count > 0 ? learned_from(any, record_once(program, true, nullptr)) : learned_from(any, any);
  RecordedStep step{record_once(program, false, &learned).graph, {}};
  if (r.shortens) step.in_place = record_once(program, true, &learned).graph;
  return step;
}

}  // namespace lockstep::generate
