// The stages that a traced step calls instead of running them. SPDX-License-Identifier: Apache-2.0
//
// A stage whose work depends on the values in its lanes has no straight-line code. The kernels call it by its name with
// a Tile<Traced>. Then the overloads below match better than the kernels' own templates. They record a call, which
// compiled and generated code make on the tile in memory. Include this before kernels/step.h.
#pragma once

#include "kernels/tile/control.h"
#include "tracer.h"

namespace lockstep::kernels {

using trace::Traced;

void keep_state(Tile<Traced>& x);
/// Refuses: the tables alone solve contacts.
bool find_contacts(const Tables<double>& t, Tile<Traced>& x);
inline void touch(const Tables<double>&, const StatePointers<double>&, bool, Tile<Traced>&) {}
inline void subtract_loops(const Tables<double>&, const Tile<Traced>&, Traced*) {}
inline void clear_loop_forces(const Tables<double>&, Tile<Traced>&) {}
inline void add_loop_impulses(const Tables<double>&, Traced::Mask, Tile<Traced>&) {}
inline void end_loop_forces(const Tables<double>&, double, Tile<Traced>&) {}
inline void subtract_contacts(const Tables<double>&, const Tile<Traced>&, Traced*) {}
inline void add_contact_work(const Tables<double>&, const Traced*, Tile<Traced>&, Traced&, Traced&) {}
/// Refuses: the tables alone have functions of joints and spatial tendons.
void changing_shares(const Tables<double>& t, Tile<Traced>& x);
void find_loops(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void find_contacts_at_midpoint(const Tables<double>& t, Tile<Traced>& x);
inline void step_from_midpoint(const Tables<double>&, const StatePointers<double>&, Tile<Traced>&, int) {}
inline void close_loops(const Tables<double>&, const StatePointers<double>&, Tile<Traced>&) {}
inline void remember_midpoint(const Tables<double>&, Tile<Traced>&) {}
inline void copy_contacts(const Tables<double>&, Tile<Traced>&, Traced*) {}
void first_saturation_pass(Tile<Traced>& x);
void limited_drives(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
bool saturation_differs(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void clear_bounds(Tile<Traced>& x);
bool bounds_active(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void solve_bounds(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void bound_prediction(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x, int time);
void bound_stages(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x, int time);
bool all_bounded(const Tables<double>& t, const Tile<Traced>& x);
/// Halves of halves are a call.
void take_halves(const Tables<double>& t, const StatePointers<double>& batch, Traced::Mask lanes, int depth,
                 Tile<Traced>& x);
inline void restore_contacts(const Tables<double>&, Traced::Mask, const Traced*, Tile<Traced>&) {}
void judge(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void step_again_if(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void audit_if(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void settle(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void coupling_impulses(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void diagnose(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
void check(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x);
/// Refuses: the tables alone have actuators.
void actuate(const Tables<double>& t, const StatePointers<double>& batch, const Tile<Traced>& x);
/// Refuses: the tables alone record calls.
void add_records(const Tables<double>& t, Tile<Traced>& x);
void hold_if(const Tables<double>& t, const StatePointers<double>& batch, Tile<Traced>& x, Traced::Mask held,
             Traced::Mask failed);

// Control as data: scopes of the graph. When operations are only counted, everything runs once.
template <class Body>
void when(Tile<Traced>&, Traced::Mask mask, Body&& body) {
  trace::counting ? body() : trace::tracer->when(mask.id, false, body);
}
template <class Yes, class No>
void either_way(Tile<Traced>&, Traced::Mask mask, Yes&& yes, No&& no) {
  if (trace::counting) return yes();
  trace::tracer->when(mask.id, false, yes);
  trace::tracer->when(mask.id, true, no);
}
template <class Body>
void repeat_while(Tile<Traced>&, Traced::Mask& mask, int most, Body&& body) {
  trace::counting ? body() : trace::tracer->repeat_while(mask.id, most, body);
}
template <class Body>
void subroutine(const Tables<double>& t, Tile<Traced>&, const char* name, Body&& body) {
  trace::counting ? body() : trace::tracer->subroutine({&t, name}, body);
}

/// Records a loop of sweeps as a loop. `carried` are the arrays that each turn hands to the next.
template <int N, class Turn>
void repeat(int times, const Tile<Traced>&, Traced* const (&carried)[N], int length, Turn&& turn) {
  if (times < 2 || trace::counting) {
    for (int i = 0; i < times; ++i) turn();
    return;
  }
  const auto gather = [&] {
    std::vector<trace::Id> all;
    for (Traced* array : carried)
      for (int i = 0; i < length; ++i) all.push_back(array[i].id);
    return all;
  };
  const auto spread = [&](const std::vector<trace::Id>& all) {
    for (int a = 0; a < N; ++a)
      for (int i = 0; i < length; ++i) carried[a][i] = Traced::of(all[a * length + i]);
  };
  spread(trace::tracer->graph.begin_loop(times, gather()));
  turn();
  spread(trace::tracer->graph.end_loop(gather()));
}

}  // namespace lockstep::kernels
