// A step as a list of operations, each done for many tiles before the next one. SPDX-License-Identifier: Apache-2.0
//
// Vectorised interpretation (Boncz, Zukowski, Nes 2005): finding out what to do is paid once for eight tiles, and the list
// holds what one plan needs and no more, as generated code does. Of twice as many tiles the numbers leave the first cache
// and small batches have no more than half. Those of a long step leave it anyway, and the stages' loops are faster then:
// docs/kernels.md has from where on.
#pragma once

#include "../plan/operations.h"
#include "step.h"

namespace lockstep::kernels {

constexpr int tiles_at_once = 8;

/// One number of each tile.
template <class T>
struct Slot {
  T tile[tiles_at_once];
};

/// Keeps where the tile's arrays begin, in their order. A list names no more of them than there is room for.
struct Places : Carver {
  static constexpr int most = 160;
  struct Firsts {
    std::ptrdiff_t first[most];
    int count = 0;
  };
  LOCKSTEP_INLINE explicit Places(Firsts& firsts) : Carver(nullptr), firsts_(&firsts) {}
  template <class E>
  LOCKSTEP_INLINE void operator()(const char* name, E*& array, int count, Lasts lasts = Lasts::step) {
    Carver::operator()(name, array, count, lasts);
    if (firsts_->count < most) firsts_->first[firsts_->count] = reinterpret_cast<std::ptrdiff_t>(array);
    ++firsts_->count;
  }

 private:
  Firsts* firsts_;
};

/// Tiles that go through the list together, and their slots.
template <class T>
struct Listed {
  using S = ScalarOf<T>;
  static constexpr int most = tiles_at_once;

  // Most of it stays as it is until it is wanted: filling it would take as long as ten steps of a tile.
  Listed(const Tables<S>& tables, const OperationList& operations) : t(tables), list(&operations) {}

  // Where they are not apart there is one tile for all, between the rows and the slots.
  LOCKSTEP_INLINE int which(int k) const { return list->apart ? k : 0; }
  LOCKSTEP_INLINE Tile<T>& tile(int k) { return x[which(k)]; }

  const Tables<S>& t;
  const OperationList* list;  // and its slots, of the two that there may be
  Slot<T>* slots;
  std::byte* block[most];     // of the tile's arrays
  Places::Firsts arrays;
  Tile<T> x[most];
  Lanes<S> lanes[most];
  int tiles = 0;
};

template <class S>
LOCKSTEP_INLINE const S* row_of(const Lanes<S>& lanes, const Access& access) {
  const std::ptrdiff_t row = access.number * lanes.stride;
  switch (access.array) {
    case Access::position_target: return lanes.position_target + row;
    case Access::velocity_target: return lanes.velocity_target + row;
    case Access::effort: return lanes.effort + row;
    default: return lanes.field[access.array - Access::field] + row;
  }
}

template <class T>
LOCKSTEP_INLINE T& number_of(Listed<T>& l, int k, const Access& access) {
  return reinterpret_cast<T*>(l.block[l.which(k)] + l.arrays.first[access.array])[access.number];
}

template <class T>
LOCKSTEP_INLINE typename T::Mask mask_of(const T& number) {
  return {bits(number)};
}
template <class T>
LOCKSTEP_INLINE T number_from(typename T::Mask mask) {
  return T::from_bits(mask.bits);
}

template <class T>
LOCKSTEP_INLINE void read_place(Listed<T>& l, int k, const Access& access) {
  T& to = l.slots[access.slot].tile[k];
  if (access.array >= Access::first_row)
    to = T::load(row_of(l.lanes[k], access));
  else if (access.array >= 0)
    to = number_of(l, k, access);
  else
    to = number_from<T>(access.array == Access::frozen ? l.tile(k).frozen : l.tile(k).singular);
}

template <class T>
LOCKSTEP_INLINE void write_place(Listed<T>& l, int k, const Access& access, typename T::Mask& failed) {
  const T& from = l.slots[access.slot].tile[k];
  switch (access.array) {
    case Access::frozen: l.tile(k).frozen = mask_of(from); break;
    case Access::singular: l.tile(k).singular = mask_of(from); break;
    case Access::suspect: l.tile(k).suspect = mask_of(from); break;
    case Access::failed: failed = mask_of(from); break;
    default: number_of(l, k, access) = from;
  }
}

template <class T>
void call(Call wanted, const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  switch (wanted) {
    case Call::compete:
      forget_bounds(x);
      if (bounds_act(t, x)) compete(t, lanes, x);
      break;
    case Call::coupling_impulses: coupling_impulses(t, x); break;
    default: diagnose(t, lanes, x);
  }
}

/// hold() for tiles with frozen lanes, compete() for those that come near a bound.
template <class T>
void call_if(Listed<T>& l, const Operation& o) {
  const Access* const accesses = l.list->accesses.data;
  for (int k = 0; k < l.tiles; ++k) {
    if (!any(mask_of(l.slots[o.a].tile[k]))) continue;
    typename T::Mask failed = T::none();
    for (int i = o.b; i < o.c; ++i) write_place(l, k, accesses[i], failed);
    if (static_cast<Call>(o.d) == Call::hold)
      hold(l.t, l.lanes[k], l.tile(k), failed);
    else
      compete(l.t, l.lanes[k], l.tile(k));
    for (int i = o.c; i < o.to; ++i) read_place(l, k, accesses[i]);
  }
}

/// A constant, as a slot would hold it.
template <class T>
struct Constant {
  T number;
  LOCKSTEP_INLINE T operator[](int) const { return number; }
};

/// One operation after the other, for N tiles, or for as many as there are where N is 0. `first` finds what stands for a.
template <int N, class T, class First, class Act>
LOCKSTEP_INLINE void each(Slot<T>* slots, int tiles, const Operation* o, const Operation* last, First&& first, Act&& act) {
  if constexpr (N > 0) tiles = N;
  do {
    T* const to = slots[o->to].tile;
    const auto a = first(o->a);
    const T *const b = slots[o->b].tile, *const c = slots[o->c].tile;
    const T *const d = slots[o->d].tile, *const e = slots[o->e].tile;
#pragma GCC unroll 8
    for (int k = 0; k < tiles; ++k) to[k] = act(a[k], b[k], c[k], d[k], e[k]);
  } while (++o != last);
}

/// What is more than an operation on slots. Apart, so that registers are left to the operations.
template <class T>
[[gnu::noinline]] void do_other(Listed<T>& l, Does does, const Operation& o) {
  if (does == Does::call_if) return call_if(l, o);
  typename T::Mask failed;
  for (int k = 0; k < l.tiles; ++k) {
    if (does == Does::sincos)
      sincos(l.slots[o.a].tile[k], l.slots[o.to].tile[k], l.slots[o.c].tile[k]);
    else if (does == Does::read)
      read_place(l, k, l.list->accesses[o.a]);
    else if (does == Does::write)
      write_place(l, k, l.list->accesses[o.a], failed);
    else
      call(static_cast<Call>(o.to), l.t, l.lanes[k], l.tile(k));
  }
}

template <int N, class T>
[[gnu::noinline]] void go_through(Listed<T>& l, Span<Run> runs) {
  const auto number = [](typename T::Mask mask) LOCKSTEP_INLINED { return number_from<T>(mask); };
  Slot<T>* const slots = l.slots;
  const double* const constants = l.list->constants.data;
  const int tiles = l.tiles;
  const auto slot = [=](int a) LOCKSTEP_INLINED -> const T* { return slots[a].tile; };
  const auto constant = [=](int a) LOCKSTEP_INLINED { return Constant<T>{T(static_cast<ScalarOf<T>>(constants[a]))}; };
  for (const Run *run = runs.data, *end = run + runs.count; run != end; ++run) {
    switch (run->does) {
#define LOCKSTEP_EACH_OF(operand, does, value)                                                          \
  case Does::does:                                                                                      \
    each<N>(slots, tiles, run->first, run->last, operand,                                               \
            [&]([[maybe_unused]] T a, [[maybe_unused]] T b, [[maybe_unused]] T c, [[maybe_unused]] T d, \
                [[maybe_unused]] T e) LOCKSTEP_INLINED { return value; });                              \
    break
#define LOCKSTEP_EACH(does, value) LOCKSTEP_EACH_OF(slot, does, value)
#define LOCKSTEP_EACH_CONSTANT(does, value) LOCKSTEP_EACH_OF(constant, does, value)
      LOCKSTEP_EACH(copy, a);
      LOCKSTEP_EACH(negate, -a);
      LOCKSTEP_EACH(add, a + b);
      LOCKSTEP_EACH(subtract, a - b);
      LOCKSTEP_EACH(multiply, a * b);
      LOCKSTEP_EACH(divide, a / b);
      LOCKSTEP_EACH(fma, fma(a, b, c));
      LOCKSTEP_EACH(fnma, fnma(a, b, c));
      LOCKSTEP_EACH(fms, fma(a, b, -c));
      LOCKSTEP_EACH(fma_multiply, fma(a, b, c * d));
      LOCKSTEP_EACH(fnma_multiply, fnma(a, b, c * d));
      LOCKSTEP_EACH(fms_multiply, fma(a, b, -(c * d)));
      LOCKSTEP_EACH(fma_fma, fma(a, b, fma(c, d, e)));
      LOCKSTEP_EACH(fma_fnma, fma(a, b, fnma(c, d, e)));
      LOCKSTEP_EACH(fnma_fma, fnma(a, b, fma(c, d, e)));
      LOCKSTEP_EACH(fnma_fnma, fnma(a, b, fnma(c, d, e)));
      LOCKSTEP_EACH(sqrt, sqrt(a));
      LOCKSTEP_EACH(farther, farther(a, b));
      LOCKSTEP_EACH(less, number(less(a, b)));
      LOCKSTEP_EACH(beyond, number(beyond(b, a)));
      LOCKSTEP_EACH(either, number(mask_of(a) | mask_of(b)));
      LOCKSTEP_EACH(both, number(mask_of(a) & mask_of(b)));
      LOCKSTEP_EACH(invert, number(~mask_of(a)));
      LOCKSTEP_EACH(select, select(mask_of(a), b, c));
      LOCKSTEP_EACH_CONSTANT(add_constant, a + b);
      LOCKSTEP_EACH_CONSTANT(subtract_from_constant, a - b);
      LOCKSTEP_EACH_CONSTANT(multiply_constant, a * b);
      LOCKSTEP_EACH_CONSTANT(fma_constant, fma(a, b, c));
      LOCKSTEP_EACH_CONSTANT(fnma_constant, fnma(a, b, c));
      LOCKSTEP_EACH_CONSTANT(beyond_constant, number(beyond(b, a)));
      LOCKSTEP_EACH_CONSTANT(fill, a);
      LOCKSTEP_EACH_CONSTANT(fill_rounding, T::rounding());
#undef LOCKSTEP_EACH
#undef LOCKSTEP_EACH_CONSTANT
#undef LOCKSTEP_EACH_OF
      case Does::sincos:
      case Does::read:
      case Does::write:
      case Does::call:
      case Does::call_if:
        for (const Operation* o = run->first; o != run->last; ++o) do_other(l, run->does, *o);
        break;
      default: __builtin_unreachable();
    }
  }
}

/// From the batch into the tiles' slots, as many as there is room for. False and not all of them where one is not in
/// place and should be.
template <class T>
bool begin_tiles(Listed<T>& l, const Lanes<ScalarOf<T>>& lanes, std::ptrdiff_t first, std::ptrdiff_t last, bool in_place) {
  for (l.tiles = 0; l.tiles < l.most && first < last; ++l.tiles, first += T::lanes) {
    const int k = l.tiles;
    l.lanes[k] = at(lanes, first, outline(l.t));
    load(l.t, l.lanes[k], l.tile(k));
    if (in_place && !l.tile(k).in_place) return false;
    settle(l.t, l.tile(k), in_place);  // all of them alike
    for (int i = 0; i < l.list->before.count; ++i) read_place(l, k, l.list->before[i]);
  }
  return true;
}
/// And back.
template <class T>
LOCKSTEP_INLINE void end_tile(Listed<T>& l, int k) {
  typename T::Mask failed;
  for (int i = 0; i < l.list->after.count; ++i) write_place(l, k, l.list->after[i], failed);
  store(l.t, l.lanes[k], l.tile(k));
}

/// Bytes between the arrays of two tiles: not a power of two, or they would meet in the cache.
LOCKSTEP_INLINE std::size_t spread_out(std::size_t bytes) { return bytes + (bytes / 64 % 2 == 0 ? 64 : 0); }

/// Bytes of scratch memory for the tiles' arrays and the slots.
template <class T>
std::size_t listed_bytes(const Tables<ScalarOf<T>>& t, const OperationList& list) {
  Tile<T> x;
  const int slots = list.slots + (list.in_place ? list.in_place->slots : 0);
  return (list.apart ? tiles_at_once : 1) * spread_out(lay_out(t, nullptr, x)) +
         static_cast<std::size_t>(slots) * sizeof(Slot<T>);
}

/// The step of the tiles at hand.
template <class T>
LOCKSTEP_INLINE void go_through(Listed<T>& l) {
  if (l.tiles == Listed<T>::most)
    go_through<Listed<T>::most>(l, l.list->runs);
  else
    go_through<0>(l, l.list->runs);
}

/// advance() of step.h by the list.
template <class T>
void advance_listed(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, std::ptrdiff_t first, std::ptrdiff_t last,
                    int substeps, void* scratch, const OperationList& list) {
  const simd::FlushDenormals flush;
  Listed<T> l(t, list);
  const OperationList* const lists[2] = {&list, list.in_place};
  Slot<T>* const slots[2] = {static_cast<Slot<T>*>(scratch), static_cast<Slot<T>*>(scratch) + list.slots};
  std::byte* behind = reinterpret_cast<std::byte*>(slots[1] + (list.in_place ? list.in_place->slots : 0));
  Places places(l.arrays);
  arrays(t, l.x[0], places);
  for (int k = 0; k <= l.which(l.most - 1) && k * T::lanes < last - first; ++k) {
    l.block[k] = behind;
    behind += spread_out(lay_out(t, behind, l.x[k]));
    uniform_masses(t, l.x[k]);
    uniform_ratios(t, l.x[k]);
  }
  const auto take = [&](int which) LOCKSTEP_INLINED {
    l.list = lists[which];
    l.slots = slots[which];
  };
  const int shortest = list.in_place ? 1 : 0;
  l.tiles = l.most;
  for (int which = 0; which <= shortest; ++which) {
    take(which);
    go_through<Listed<T>::most>(l, l.list->constants_first);
  }
  while (first < last) {
    take(shortest);
    if (!begin_tiles(l, lanes, first, last, shortest > 0)) {
      take(0);
      begin_tiles(l, lanes, first, last, false);
    }
    for (int i = 0; i < substeps; ++i) go_through(l);
    for (int k = 0; k < l.tiles; ++k) end_tile(l, k);
    first += l.tiles * T::lanes;
  }
}

}  // namespace lockstep::kernels
