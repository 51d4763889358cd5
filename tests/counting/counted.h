// A number that counts the operations on it, for kernels to run on. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>

#include "simd/sincos.h"

namespace lockstep {

struct OperationCount {
  long flops = 0;
  std::set<const void*> loaded, stored;  ///< addresses in a batch that were read and written
};
inline thread_local OperationCount operation_count;

/// Behaves like Wide<float, 1, Unfused>. A multiply-add counts as two operations; moves, signs, comparisons and
/// selections do not count.
struct Counted {
  using Scalar = float;
  using Plain = simd::Wide<float, 1, simd::Unfused>;
  using Mask = Plain::Mask;
  static constexpr int lanes = 1;

  Plain v;

  Counted() = default;
  Counted(float scalar) : v(scalar) {}
  Counted(Plain plain) : v(plain) {}

  static Counted after(int flops, Plain result) {
    operation_count.flops += flops;
    return result;
  }
  friend Counted operator+(Counted a, Counted b) { return after(1, a.v + b.v); }
  friend Counted operator-(Counted a, Counted b) { return after(1, a.v - b.v); }
  friend Counted operator*(Counted a, Counted b) { return after(1, a.v * b.v); }
  friend Counted operator/(Counted a, Counted b) { return after(1, a.v / b.v); }
  friend Counted operator-(Counted a) { return -a.v; }
  Counted& operator+=(Counted b) { return *this = *this + b; }
  Counted& operator-=(Counted b) { return *this = *this - b; }
  Counted& operator*=(Counted b) { return *this = *this * b; }
  friend Counted fma(Counted a, Counted b, Counted c) { return after(2, fma(a.v, b.v, c.v)); }
  friend Counted fnma(Counted a, Counted b, Counted c) { return after(2, fnma(a.v, b.v, c.v)); }
  friend Counted sqrt(Counted a) { return after(1, sqrt(a.v)); }
  friend void sincos(Counted x, Counted& sine, Counted& cosine) {
    sincos(x.v, sine.v, cosine.v);
    operation_count.flops += simd::sincos_flops<float>;
  }
  friend Mask less(Counted a, Counted b) { return less(a.v, b.v); }
  friend Mask beyond(Counted a, Counted b) { return beyond(a.v, b.v); }
  friend Counted farther(Counted a, Counted b) { return farther(a.v, b.v); }
  friend Counted select(Mask m, Counted yes, Counted no) { return select(m, yes.v, no.v); }
  friend Counted truncated(Counted a) { return truncated(a.v); }
  friend Counted gather(const float* table, Counted index) { return gather(table, index.v); }
  static Mask none() { return Plain::none(); }
  static Counted rounding() { return Plain::rounding(); }
  static Counted by_precision(double single, double twice) { return Plain::by_precision(single, twice); }
  float lane(int i) const { return v.lane(i); }
  void set_lane(int i, float value) { v.set_lane(i, value); }
  static Counted load(const float* p) {
    operation_count.loaded.insert(p);
    return Plain::load(p);
  }
  friend void store(float* p, Counted a) {
    operation_count.stored.insert(p);
    store(p, a.v);
  }
};

}  // namespace lockstep
