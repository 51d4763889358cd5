// Steps by machine code: what it needs of the kernels. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"
#include "kernels/step.h"
#include "kernels/tile/own_numbers.h"

namespace lockstep::kernels {

/// Keeps where each array of a tile begins, in memory order.
struct ArrayPlaces : Carver {
  LOCKSTEP_INLINE explicit ArrayPlaces(jit::TilePlaces& places) : Carver(nullptr), places_(&places) {}
  template <class E>
  LOCKSTEP_INLINE void operator()(const char* name, E*& array, int count, Lifetime lasts = Lifetime::step) {
    Carver::operator()(name, array, count, lasts);
    if (places_->arrays < jit::TilePlaces::most_arrays)
      places_->first[places_->arrays] = reinterpret_cast<std::ptrdiff_t>(array);
    ++places_->arrays;
  }

 private:
  jit::TilePlaces* places_;
};

/// Runs the stage that machine code calls, on the tile in memory.
template <class T>
void call_stage(const jit::Frame* frame, int stage) {
  const auto& t = *static_cast<const Tables<ScalarOf<T>>*>(frame->tables);
  const auto& batch = *static_cast<const StatePointers<ScalarOf<T>>*>(frame->batch);
  Tile<T>& x = *static_cast<Tile<T>*>(frame->tile);
  switch (static_cast<Call>(stage)) {
    case Call::bounds:
      clear_bounds(x);
      if (bounds_active(t, batch, x)) solve_bounds(t, batch, x);
      break;
    case Call::solve_bounds: solve_bounds(t, batch, x); break;
    case Call::coupling_impulses: coupling_impulses(t, batch, x); break;
    case Call::diagnose: diagnose(t, batch, x); break;
    case Call::hold: hold(t, batch, x, *static_cast<const typename T::Mask*>(frame->slots)); break;
    case Call::step_again: step_again(t, batch, x); break;
    case Call::halves: halve_again(t, batch, 0, x); break;
    case Call::quarters: halve_again(t, batch, 1, x); break;
    case Call::none: break;
  }
}

template <class T>
void find_places(const Tables<ScalarOf<T>>& t, jit::TilePlaces& places) {
  Tile<T> x;
  ArrayPlaces take(places);
  arrays(t, x, take);
  int own = 0;
  each_own(x, [&](const char*, const auto& number, Lifetime) {
    if (own < jit::TilePlaces::most_own)
      places.own[own++] = reinterpret_cast<const char*>(&number) - reinterpret_cast<const char*>(&x);
  });
  places.bytes = static_cast<int>(sizeof(T));
  places.fused = T::fused;
  places.call = call_stage<T>;
}

/// A step by machine code, in place of ByTables.
struct ByCode {
  static constexpr int tiles_per_call = 2;
  const jit::StepCode& code;
  jit::Frame frame[tiles_per_call];

  LOCKSTEP_INLINE int tiles() const { return code.tiles; }
  LOCKSTEP_INLINE int carried() const { return code.slots; }
  template <class S>
  LOCKSTEP_INLINE static TileShape shape(const Tables<S>& t) {
    return kernels::tile_shape(t);
  }
  /// Tile k has been loaded: the rows that the code reads go to their slots.
  template <class T>
  LOCKSTEP_INLINE void begin(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                             T* slots, int k) {
    frame[k] = {x.state.q, slots, &x, &t, &batch};
    for (int i = 0; i < code.rows.count; ++i) slots[1 + i] = T::load(row_of(batch, code.rows[i]));
  }
  template <class T>
  LOCKSTEP_INLINE void step(const Tables<ScalarOf<T>>&, const StatePointers<ScalarOf<T>>*, Tile<T>* x, T* const*,
                            int tiles) {
    bool consistent = code.consistent != nullptr;
    for (int k = 0; k < tiles; ++k) consistent = consistent && x[k].consistent;
    (consistent ? code.consistent : code.any)(frame, frame + tiles);
  }

 protected:
  template <class S>
  LOCKSTEP_INLINE static const S* row_of(const StatePointers<S>& batch, const Access& access) {
    const std::ptrdiff_t row = access.number * batch.stride;
    switch (access.array) {
      case Access::position_target: return batch.position_target + row;
      case Access::velocity_target: return batch.velocity_target + row;
      case Access::effort: return batch.effort + row;
      default: return batch.fields[access.array - Access::field] + row;
    }
  }
};

/// A step by the tables, whose routines are machine code.
struct ByRoutines : ByCode {
  static constexpr int tiles_per_call = 1;

  LOCKSTEP_INLINE int tiles() const { return 1; }
  template <class T>
  LOCKSTEP_INLINE void begin(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                             T* slots, int k) {
    ByCode::begin(t, batch, x, slots, k);
    x.routines = {code.routine, &t, t.midpoint ? t.midpoint : &t, frame, frame + 1};
    x.unread_inputs = T(0);
    for (int i = 0; i < code.unread.count; ++i)
      x.unread_inputs = farther(x.unread_inputs, T::load(row_of(batch, code.unread[i])));
  }
  template <class T>
  LOCKSTEP_INLINE void step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>* batch, Tile<T>* x,
                            T* const*, int) {
    kernels::step(t, *batch, *x);
  }
};

/// advance() of step.h, by machine code.
template <class T>
void advance_by_code(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
                     std::ptrdiff_t last, int substeps, void* scratch, const jit::StepCode& code) {
  if (code.any)
    advance<T>(t, batch, first, last, substeps, scratch, ByCode{code, {}});
  else
    advance<T>(t, batch, first, last, substeps, scratch, ByRoutines{{code, {}}});
}

}  // namespace lockstep::kernels
