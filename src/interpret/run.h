// Runs a step as a list of operations, each for several tiles before the next. SPDX-License-Identifier: Apache-2.0
//
// Vectorised interpretation (Boncz, Zukowski, Nes 2005): an operation is dispatched once for eight tiles. The list has
// only what one plan needs, as generated code does. Loads and stores limit its speed. So the last result of each tile
// stays in a register, and a number that only the next operation uses is never stored. More than eight tiles would not
// fit into the registers, and their numbers would leave the first cache. Numbers of a long step leave it with eight
// tiles too; then the tables are faster (docs/kernels.md).
#pragma once

#include "evaluate.h"
#include "kernels/step.h"

namespace lockstep::kernels {

constexpr int tiles_at_once = OperationList::tiles_at_once;

/// A place for one number of each tile.
template <class T>
struct Slot {
  T tile[tiles_at_once];
};

/// Keeps where each array of a tile begins, in memory order.
struct Places : Carver {
  static constexpr int most = 256;  // arrays that a list can name
  struct Firsts {
    std::ptrdiff_t first[most];
    int count = 0;
  };
  LOCKSTEP_INLINE explicit Places(Firsts& firsts) : Carver(nullptr), firsts_(&firsts) {}
  template <class E>
  LOCKSTEP_INLINE void operator()(const char* name, E*& array, int count, Lifetime lasts = Lifetime::step) {
    Carver::operator()(name, array, count, lasts);
    if (firsts_->count < most) firsts_->first[firsts_->count] = reinterpret_cast<std::ptrdiff_t>(array);
    ++firsts_->count;
  }

 private:
  Firsts* firsts_;
};

/// The tiles that go through the list together, and their slots.
template <class T>
struct InterpreterTiles {
  using S = ScalarOf<T>;
  static constexpr int most = tiles_at_once;

  // Leaves most members uninitialised, because to fill them would take as long as ten steps of a tile.
  InterpreterTiles(const Tables<S>& tables, const OperationList& operations) : t(tables), list(&operations) {}

  // One tile in memory serves all, between the rows and the slots, unless they need arrays of their own.
  LOCKSTEP_INLINE int which(int k) const { return list->apart ? k : 0; }
  LOCKSTEP_INLINE Tile<T>& tile(int k) { return x[which(k)]; }

  const Tables<S>& t;
  const OperationList* list;  // the list that runs, of up to two; `slots` are its own
  Slot<T>* slots;
  std::byte* block[most];  // where the arrays of the tile begin
  Places::Firsts arrays;
  Tile<T> x[most];
  StatePointers<S> batch[most];
  int tiles = 0;
  bool shorter = false;     // the list is that of consistent followers, which has the offsets of the plan
  bool has_turned = false;  // a joint has completed a turn in the last step
};

template <class S>
LOCKSTEP_INLINE const S* row_of(const StatePointers<S>& batch, const Access& access) {
  const std::ptrdiff_t row = access.number * batch.stride;
  switch (access.array) {
    case Access::position_target: return batch.position_target + row;
    case Access::velocity_target: return batch.velocity_target + row;
    case Access::effort: return batch.effort + row;
    default: return batch.fields[access.array - Access::field] + row;
  }
}

template <class T>
LOCKSTEP_INLINE T& number_of(InterpreterTiles<T>& l, int k, const Access& access) {
  return reinterpret_cast<T*>(l.block[l.which(k)] + l.arrays.first[access.array])[access.number];
}

template <class T>
LOCKSTEP_INLINE void read_place(InterpreterTiles<T>& l, int k, const Access& access) {
  T& to = l.slots[access.slot].tile[k];
  if (access.array >= Access::first_row)
    to = T::load(row_of(l.batch[k], access));
  else if (access.array >= 0)
    to = number_of(l, k, access);
  else
    to = number_from<T>(access.array == Access::frozen     ? l.tile(k).frozen
                        : access.array == Access::singular ? l.tile(k).singular
                                                           : l.tile(k).too_fast);
}

template <class T>
LOCKSTEP_INLINE void write_place(InterpreterTiles<T>& l, int k, const Access& access, typename T::Mask& failed) {
  const T& from = l.slots[access.slot].tile[k];
  switch (access.array) {
    case Access::frozen: l.tile(k).frozen = mask_of(from); break;
    case Access::singular: l.tile(k).singular = mask_of(from); break;
    case Access::fast: l.tile(k).audit.fast = mask_of(from); break;
    case Access::too_fast: l.tile(k).too_fast = mask_of(from); break;
    case Access::candidate: l.tile(k).bounds.candidate = mask_of(from); break;
    case Access::failed: failed = mask_of(from); break;
    default: number_of(l, k, access) = from;
  }
}

template <class T>
void call(Call wanted, const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  switch (wanted) {
    case Call::solve_bounds:
      clear_bounds(x);
      if (bounds_active(t, batch, x)) solve_bounds(t, batch, x);
      break;
    case Call::coupling_impulses: coupling_impulses(t, batch, x); break;
    default: diagnose(t, batch, x);
  }
}

/// Calls hold() for tiles with frozen lanes, or solve_bounds() or step_again() for tiles with candidate lanes.
template <class T>
void call_if(InterpreterTiles<T>& l, const Operation& o) {
  const Access* const accesses = l.list->accesses.data;
  for (int k = 0; k < l.tiles; ++k) {
    if (!any(mask_of(l.slots[o.to].tile[k]))) continue;
    typename T::Mask failed = T::none();
    for (int i = o.a; i < o.b; ++i) write_place(l, k, accesses[i], failed);
    if (static_cast<Call>(o.d) == Call::hold && l.shorter)
      l.has_turned = hold_frozen(l.t, l.batch[k], l.tile(k), failed) || l.has_turned;
    else if (static_cast<Call>(o.d) == Call::hold)
      hold(l.t, l.batch[k], l.tile(k), failed);
    else if (static_cast<Call>(o.d) == Call::step_again)
      step_again(l.t, l.batch[k], l.tile(k));
    else if (static_cast<Call>(o.d) == Call::audit)
      l.tile(k).audit.known = false, audit(l.t, l.batch[k], l.tile(k));
    else
      solve_bounds(l.t, l.batch[k], l.tile(k));
    for (int i = o.b; i < o.c; ++i) read_place(l, k, accesses[i]);
  }
}

template <class T>
void sines(InterpreterTiles<T>& l, const Operation& o) {
  const T* const angle = l.slots[o.a].tile;
  T *const sine = l.slots[o.to].tile, *const cosine = l.slots[o.c].tile;
  int k = 0;
  for (; k + 4 <= l.tiles; k += 4) sincos_of_four(angle + k, sine + k, cosine + k);
  for (; k < l.tiles; ++k) sincos(angle[k], sine[k], cosine[k]);
}

/// Operations other than arithmetic. They are not inlined, because they need the registers.
template <Opcode opcode, class T>
[[gnu::noinline]] void do_other(InterpreterTiles<T>& l, const Operation& o) {
  if constexpr (opcode == Opcode::sincos) return sines(l, o);
  if constexpr (opcode == Opcode::call_if) return call_if(l, o);
  [[maybe_unused]] typename T::Mask failed;
  for (int k = 0; k < l.tiles; ++k) {
    if constexpr (opcode == Opcode::read) read_place(l, k, l.list->accesses[o.a]);
    if constexpr (opcode == Opcode::write) write_place(l, k, l.list->accesses[o.a], failed);
    if constexpr (opcode == Opcode::call) call(static_cast<Call>(o.a), l.t, l.batch[k], l.tile(k));
  }
}

/// One tile's number a, b or c, if the operation has it.
template <Encoding encoding, Last which, class T>
LOCKSTEP_INLINE T operand(const Slot<T>* slots, std::uint16_t slot, int k, T last) {
  if constexpr (static_cast<int>(which) > operands(encoding.opcode))
    return T(0);
  else if constexpr (encoding.last == which)
    return last;
  else
    return slots[slot].tile[k];
}

/// One operation on N tiles.
template <Encoding encoding, int N, class T>
LOCKSTEP_INLINE void operate(const Operation& o, Slot<T>* slots, const double* constants, InterpreterTiles<T>& l,
                             T* last) {
  if constexpr (is_arithmetic(encoding.opcode)) {
    constexpr bool of_constant = is_of_constant(encoding.opcode);
    const T constant = of_constant ? T(static_cast<ScalarOf<T>>(constants[o.a])) : T(0);
#pragma GCC unroll 8
    for (int k = 0; k < N; ++k) {
      T a = constant;
      if constexpr (!of_constant) a = operand<encoding, Last::a>(slots, o.a, k, last[k]);
      last[k] = evaluate<encoding.opcode>(a, operand<encoding, Last::b>(slots, o.b, k, last[k]),
                                          operand<encoding, Last::c>(slots, o.c, k, last[k]));
    }
    if constexpr (!encoding.stored) return;
    T* const to = slots[o.to].tile;
#pragma GCC unroll 8
    for (int k = 0; k < N; ++k) to[k] = last[k];
  } else {
    do_other<encoding.opcode>(l, o);
  }
}

/// The same, or the two operations of a superoperator.
template <int encoding, int N, class T>
LOCKSTEP_INLINE void operate(const Operation*& o, Slot<T>* slots, const double* constants, InterpreterTiles<T>& l,
                             T* last) {
  if constexpr (encoding < single_encodings) {
    operate<Encoding::of(encoding), N>(*o++, slots, constants, l, last);
  } else {
    constexpr Superoperator both = Superoperator::of(encoding - single_encodings);
    operate<both.first, N>(*o++, slots, constants, l, last);
    operate<both.second, N>(*o++, slots, constants, l, last);
  }
}

template <int N, class T>
struct Acts;

#if defined(__OPTIMIZE__) && !defined(LOCKSTEP_SANITIZED)

/// One operation, and then all that follow it. What they share is in arguments, also the last result of each tile, so
/// it stays in registers. A call that ends a function is a jump. Each encoding has a jump of its own, which processors
/// predict better than one jump for all (Ertl and Gregg 2003).
template <class T>
using Act = void (*)(const Operation* o, Slot<T>* slots, const double* constants, InterpreterTiles<T>& l, T, T, T, T, T,
                     T, T, T);

template <int encoding, int N, class T>
void act(const Operation* o, Slot<T>* slots, const double* constants, InterpreterTiles<T>& l, T last0, T last1, T last2,
         T last3, T last4, T last5, T last6, T last7) {
  constexpr Opcode opcode = encoding < single_encodings ? Encoding::of(encoding).opcode : Opcode::fma;
  if constexpr (is_arithmetic(opcode)) {
    T last[tiles_at_once] = {last0, last1, last2, last3, last4, last5, last6, last7};
    operate<encoding, N>(o, slots, constants, l, last);
    return Acts<N, T>::all.of[o->encoding](o, slots, constants, l, last[0], last[1], last[2], last[3], last[4], last[5],
                                           last[6], last[7]);
  } else if constexpr (opcode != Opcode::end) {
    operate<encoding, N, T>(o, slots, constants, l, nullptr);
    const T none(0);  // the next operation does not use last results, so none are kept over the call
    return Acts<N, T>::all.of[o->encoding](o, slots, constants, l, none, none, none, none, none, none, none, none);
  }
}

template <int N, class T>
LOCKSTEP_INLINE void run(InterpreterTiles<T>& l, Span<Operation> list) {
  const T none(0);
  Acts<N, T>::all.of[list[0].encoding](list.data, l.slots, l.list->constants.data, l, none, none, none, none, none,
                                       none, none, none);
}

#else

/// One operation. Without optimisation the calls above would not become jumps and would nest, so a loop makes them.
/// That is slower.
template <class T>
using Act = void (*)(const Operation*& o, Slot<T>* slots, const double* constants, InterpreterTiles<T>& l, T* last);

template <int encoding, int N, class T>
void act(const Operation*& o, Slot<T>* slots, const double* constants, InterpreterTiles<T>& l, T* last) {
  operate<encoding, N>(o, slots, constants, l, last);
}

template <int N, class T>
void run(InterpreterTiles<T>& l, Span<Operation> list) {
  T last[tiles_at_once] = {};
  for (const Operation* o = list.data; o->encoding != Encoding{Opcode::end}.number();)
    Acts<N, T>::all.of[o->encoding](o, l.slots, l.list->constants.data, l, last);
}

#endif

/// The functions by the numbers of their encodings.
template <int N, class T>
struct Acts {
  Act<T> of[all_encodings];
  static const Acts all;
};

template <int encoding, int N, class T>
constexpr void fill_from(Acts<N, T>& acts) {
  if constexpr (encoding >= single_encodings || can_be(Encoding::of(encoding))) acts.of[encoding] = act<encoding, N, T>;
  if constexpr (encoding + 1 < all_encodings) fill_from<encoding + 1>(acts);
}
template <int N, class T>
constexpr Acts<N, T> all_acts() {
  Acts<N, T> acts = {};
  fill_from<0>(acts);
  return acts;
}
template <int N, class T>
constinit const Acts<N, T> Acts<N, T>::all = all_acts<N, T>();

/// Reads tiles from the batch into the slots, as many as there is room for. With `consistent`, stops and returns false
/// at a tile that is not consistent.
template <class T>
bool begin_tiles(InterpreterTiles<T>& l, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
                 std::ptrdiff_t last, bool consistent) {
  for (l.tiles = 0; l.tiles < l.most && first < last; ++l.tiles, first += T::lanes) {
    const int k = l.tiles;
    l.batch[k] = at(l.t, batch, first);
    load(l.t, l.batch[k], l.tile(k));
    if (consistent && !l.tile(k).consistent) return false;
    set_consistent(l.t, l.tile(k), consistent);  // the same for all tiles
    for (int i = 0; i < l.list->before.count; ++i) read_place(l, k, l.list->before[i]);
  }
  return true;
}

/// Writes a tile from the slots to the batch.
template <class T>
LOCKSTEP_INLINE void end_tile(InterpreterTiles<T>& l, int k) {
  typename T::Mask failed;
  for (int i = 0; i < l.list->after.count; ++i) write_place(l, k, l.list->after[i], failed);
  if (l.shorter && l.has_turned) {  // as hold() would have left them
    if (l.tile(k).turned) no_turns(l.t, l.batch[k], l.tile(k));
    l.tile(k).turned = false;
    take_turns(l.t, l.batch[k], l.tile(k), l.tile(k).state);
  }
  store(l.t, l.batch[k], l.tile(k));
}

/// Bytes from the arrays of one tile to those of the next: an odd number of cache lines, or they would compete in the
/// cache.
LOCKSTEP_INLINE std::size_t spread_out(std::size_t bytes) { return bytes + (bytes / 64 % 2 == 0 ? 64 : 0); }

/// Bytes of scratch memory for the tiles' arrays and the slots.
template <class T>
std::size_t interpreter_bytes(const Tables<ScalarOf<T>>& t, const OperationList& list) {
  Tile<T> x;
  const int slots = list.slots + (list.consistent ? list.consistent->slots : 0);
  return (list.apart ? tiles_at_once : 1) * spread_out(lay_out(t, nullptr, x)) +
         static_cast<std::size_t>(slots) * sizeof(Slot<T>);
}

/// One step of the present tiles. Old numbers behind the last tile are stepped too, and never read.
template <class T>
LOCKSTEP_INLINE void run(InterpreterTiles<T>& l) {
  if (l.tiles > 4)
    run<8>(l, l.list->step);
  else if (l.tiles > 2)
    run<4>(l, l.list->step);
  else if (l.tiles > 1)
    run<2>(l, l.list->step);
  else
    run<1>(l, l.list->step);
}

/// advance() of step.h, by the interpreter.
template <class T>
void interpret(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
               std::ptrdiff_t last, int substeps, void* scratch, const OperationList& list) {
  const simd::StepMode mode;
  InterpreterTiles<T> l(t, list);

  // The list of a step, the shorter one of consistent tiles if there is one, and the slots of each.
  const OperationList* const lists[2] = {&list, list.consistent};
  Slot<T>* const slots[2] = {static_cast<Slot<T>*>(scratch), static_cast<Slot<T>*>(scratch) + list.slots};
  std::byte* behind = reinterpret_cast<std::byte*>(slots[1] + (list.consistent ? list.consistent->slots : 0));
  Places places(l.arrays);
  arrays(t, l.x[0], places);
  int laid_out = 0;

  // Goes over to a list, and lays out the tiles that it is the first to need.
  const auto take = [&](int which) LOCKSTEP_INLINED {
    l.list = lists[which];
    l.slots = slots[which];
    l.shorter = which > 0 && t.turning.count > 0, l.has_turned = false;
    for (; laid_out <= l.which(l.most - 1) && laid_out * T::lanes < last - first; ++laid_out) {
      l.block[laid_out] = behind;
      behind += spread_out(lay_out(t, behind, l.x[laid_out]));
      uniform_masses(t, l.x[laid_out]);
      uniform_ratios(t, l.x[laid_out]);
    }
  };

  // Numbers that never change, once for each list.
  const int shortest = list.consistent ? 1 : 0;
  l.tiles = l.most;
  for (int which = 0; which <= shortest; ++which) {
    l.list = lists[which], l.slots = slots[which];
    run<InterpreterTiles<T>::most>(l, l.list->constants_first);
  }

  // As many tiles at once as there is room for: by the shorter list if all of them are consistent.
  while (first < last) {
    take(shortest);
    if (!begin_tiles(l, batch, first, last, shortest > 0)) {
      take(0);
      begin_tiles(l, batch, first, last, false);
    }
    for (int i = 0; i < substeps; ++i) {
      for (Tile<T>& tile : l.x) tile.step = static_cast<std::uint32_t>(i);
      run(l);
      // When a joint has turned, they go on by the list of a step.
      if (!l.has_turned || i + 1 == substeps) continue;
      for (int k = 0; k < l.tiles; ++k) end_tile(l, k);
      take(0);
      begin_tiles(l, batch, first, last, false);
    }
    for (int k = 0; k < l.tiles; ++k) end_tile(l, k);
    first += l.tiles * T::lanes;
  }
}

}  // namespace lockstep::kernels
