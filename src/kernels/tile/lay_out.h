// The order of a tile's arrays in memory, and where each begins. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// Names every array of the tile to `take` in memory order: take(name, pointer, count, lifetime). A copy of `take` lays
/// out other arrays in the same memory, and take.behind(copy) continues behind the longer of the two.
template <class T, class Take>
inline void arrays(const Tables<ScalarOf<T>>& t, Tile<T>& x, Take& take) {
  x.state.arrays(t, "state.q", "state.v", "state.pose", take, Lifetime::state);
  x.next.arrays(t, "next.q", "next.v", "next.pose", take);
  take("half_turn", x.half_turn, 4 * t.roots.count);
  if (t.integrator != Integrator::euler) x.stages.arrays(t, take);
  if (t.guarded) x.guard.arrays(t, take);
  x.bodies.kinematics(t, take);
  // The arrays of the bias forces are free when the mass matrix begins. Both share memory, to stay in the cache.
  Take shared = take;
  x.bodies.bias_forces(t, take);
  x.articulated.inertias(t, shared);
  x.bodies.composites(t, shared);
  take.behind(shared);
  x.dynamics.matrices(t, take);
  if (t.articulated.used()) x.articulated.factors(t, x.state.q, take);
  x.dynamics.vectors(t, take);
  x.couplings.ratios(t, take);
  if (t.functions.used()) x.functions.arrays(t, take);
  x.rows.values(t, take);
  x.couplings.followers(t, take);
  x.rows.arrays(t, take);
  x.couplings.results(t, take);
  x.undamped.arrays(t, take);
  if (t.bounds.rows.count > 0) {
    x.bounds.arrays(t, take);
    x.search.arrays(t, take);
  }
  if (t.rounds.used()) {
    x.held.arrays(t, take);
    if (!t.rounds.renumbered) x.held.start = x.dynamics.start;
    if (t.contacts.used() || t.loops.used() || t.rounds.at_midpoint) x.rounds.arrays(t, take);
    if (t.integrator != Integrator::euler) x.stage_bounds.arrays(t, take);
    if (t.rounds.at_midpoint) x.midpoint.arrays(t, take);
  }
  x.servos.arrays(t, take);
  if (t.contacts.used()) x.contacts.arrays(t, take);
  if (t.loops.used()) x.loops.arrays(t, take);
  if (t.spatial.used()) x.spatial.arrays(t, take);
  if (t.record_diagnostics) x.diagnostics.arrays(t, take);
  if (t.records_calls()) x.records.arrays(t, take);
  if (t.audited) x.audit.arrays(t, take);
}

/// Tells the step whether all placed followers are consistent (M76). If they are, and there are neither other followers
/// nor rows to solve, both phases have the same solution.
template <class T>
LOCKSTEP_INLINE void set_consistent(const Tables<ScalarOf<T>>& t, Tile<T>& x, bool consistent) {
  const bool one_motion = consistent && t.reduction.all_placed && t.rows.count == 0 && t.bounds.rows.count == 0 &&
                          !t.contacts.used() && !t.loops.used();
  x.consistent = consistent;
  x.solves_twice = t.solve_twice && !one_motion;
}

/// Hands out consecutive pieces of the scratch block; with a null block it only measures.
class Carver {
 public:
  /// From `begin` bytes behind the start of the block.
  explicit Carver(void* block, std::size_t begin = 0) : base_(reinterpret_cast<std::uintptr_t>(block) + begin) {}
  template <class E>
  void operator()(const char*, E*& array, int count, Lifetime = Lifetime::step) {
    array = reinterpret_cast<E*>(base_ + used_);
    used_ += sizeof(E) * static_cast<std::size_t>(count);
  }
  /// Indices take whole cache lines, so that the next array stays aligned.
  void operator()(const char*, int*& array, int count, Lifetime = Lifetime::step) {
    array = reinterpret_cast<int*>(base_ + used_);
    used_ += sizeof(int) * static_cast<std::size_t>((count + 15) / 16 * 16);
  }
  /// Continues behind what `other`, a copy of this, has laid out in the same memory.
  void behind(const Carver& other) {
    if (used_ < other.used_) used_ = other.used_;
  }
  std::size_t used() const { return used_; }

 private:
  std::uintptr_t base_;  // a number: a null pointer has no address behind it
  std::size_t used_ = 0;
};

/// Lays the tile out in `block`; returns its size in bytes.
template <class T>
inline std::size_t lay_out(const Tables<ScalarOf<T>>& t, void* block, Tile<T>& x) {
  Carver carver(block);
  arrays(t, x, carver);
  x.bounds.active_count = 0;
  x.corrects_positions = true;
  x.turned = true;  // nothing is known yet
  set_consistent(t, x, false);
  return carver.used();
}

/// Lays out a tile, and a Motion behind it.
template <class T>
inline std::size_t lay_out(const Tables<ScalarOf<T>>& t, void* block, Tile<T>& x, Motion<T>& motion) {
  const std::size_t used = lay_out(t, block, x);
  Carver carver(block, used);
  motion.arrays(t, carver);
  return used + carver.used();
}

}  // namespace lockstep::kernels
