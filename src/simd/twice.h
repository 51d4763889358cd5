// Twice<T>: two registers in the place of one. SPDX-License-Identifier: Apache-2.0
//
// A step is a long chain of operations that wait for each other; a second one beside it fills the waiting. Every lane
// does what it does in T, so bits are those of T.
#pragma once

#include "wide.h"

namespace lockstep::simd {

template <class T>
struct Twice {
  using Scalar = typename T::Scalar;
  static constexpr int lanes = 2 * T::lanes;
  struct Mask {
    typename T::Mask a, b;
    LOCKSTEP_INLINE friend Mask operator|(Mask m, Mask n) { return {m.a | n.a, m.b | n.b}; }
    LOCKSTEP_INLINE friend Mask operator&(Mask m, Mask n) { return {m.a & n.a, m.b & n.b}; }
    LOCKSTEP_INLINE friend Mask operator~(Mask m) { return {~m.a, ~m.b}; }
    LOCKSTEP_INLINE friend bool any(Mask m) { return any(m.a | m.b); }
    LOCKSTEP_INLINE bool lane(int i) const { return i < T::lanes ? a.lane(i) : b.lane(i - T::lanes); }
    LOCKSTEP_INLINE friend bool lane(Mask m, int i) { return m.lane(i); }
    LOCKSTEP_INLINE void set_lane(int i, bool value) {
      i < T::lanes ? a.set_lane(i, value) : b.set_lane(i - T::lanes, value);
    }
  };

  T a, b;

  LOCKSTEP_INLINE Twice() = default;
  LOCKSTEP_INLINE Twice(T first, T second) : a(first), b(second) {}
  LOCKSTEP_INLINE Twice(Scalar scalar) : a(scalar), b(scalar) {}
  LOCKSTEP_INLINE Twice(const Twice& other) : a(other.a), b(other.b) {}
  LOCKSTEP_INLINE Twice& operator=(const Twice& other) {
    a = other.a;
    b = other.b;
    return *this;
  }

  LOCKSTEP_INLINE friend Twice operator+(Twice x, Twice y) { return {x.a + y.a, x.b + y.b}; }
  LOCKSTEP_INLINE friend Twice operator-(Twice x, Twice y) { return {x.a - y.a, x.b - y.b}; }
  LOCKSTEP_INLINE friend Twice operator*(Twice x, Twice y) { return {x.a * y.a, x.b * y.b}; }
  LOCKSTEP_INLINE friend Twice operator/(Twice x, Twice y) { return {x.a / y.a, x.b / y.b}; }
  LOCKSTEP_INLINE friend Twice operator-(Twice x) { return {-x.a, -x.b}; }
  LOCKSTEP_INLINE Twice& operator+=(Twice x) { return *this = *this + x; }
  LOCKSTEP_INLINE Twice& operator-=(Twice x) { return *this = *this - x; }
  LOCKSTEP_INLINE Twice& operator*=(Twice x) { return *this = *this * x; }
  LOCKSTEP_INLINE friend Twice fma(Twice x, Twice y, Twice z) { return {fma(x.a, y.a, z.a), fma(x.b, y.b, z.b)}; }
  LOCKSTEP_INLINE friend Twice fnma(Twice x, Twice y, Twice z) { return {fnma(x.a, y.a, z.a), fnma(x.b, y.b, z.b)}; }
  LOCKSTEP_INLINE friend Twice sqrt(Twice x) { return {sqrt(x.a), sqrt(x.b)}; }
  LOCKSTEP_INLINE friend void sincos(Twice x, Twice& sine, Twice& cosine) {
    sincos(x.a, sine.a, cosine.a);
    sincos(x.b, sine.b, cosine.b);
  }
  LOCKSTEP_INLINE friend Mask less(Twice x, Twice y) { return {less(x.a, y.a), less(x.b, y.b)}; }
  LOCKSTEP_INLINE friend Mask beyond(Twice x, Twice y) { return {beyond(x.a, y.a), beyond(x.b, y.b)}; }
  LOCKSTEP_INLINE friend Twice select(Mask m, Twice yes, Twice no) {
    return {select(m.a, yes.a, no.a), select(m.b, yes.b, no.b)};
  }
  LOCKSTEP_INLINE static Mask none() { return {T::none(), T::none()}; }
  LOCKSTEP_INLINE static Twice rounding() { return {T::rounding(), T::rounding()}; }

  LOCKSTEP_INLINE Scalar lane(int i) const { return i < T::lanes ? a.lane(i) : b.lane(i - T::lanes); }
  LOCKSTEP_INLINE void set_lane(int i, Scalar value) {
    i < T::lanes ? a.set_lane(i, value) : b.set_lane(i - T::lanes, value);
  }
  LOCKSTEP_INLINE static Twice load(const Scalar* p) { return {T::load(p), T::load(p + T::lanes)}; }
  LOCKSTEP_INLINE friend void store(Scalar* p, Twice x) {
    store(p, x.a);
    store(p + T::lanes, x.b);
  }
};

}  // namespace lockstep::simd
