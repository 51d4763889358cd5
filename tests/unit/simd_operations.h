// Operations on wide numbers behind plain functions. SPDX-License-Identifier: Apache-2.0
//
// With these, a test need not be compiled for the instruction set that it calls. The file uses no standard library: if
// an AVX2 file shared inline functions with others, the linker might keep the copy that not every machine can run.
#pragma once

#include "simd/sincos.h"

namespace lockstep::simd_test {

/// Each function reads and writes `lanes` numbers, which need no alignment.
template <class S>
struct Operations {
  const char* name;
  int lanes;
  bool fused;
  void (*sincos)(const S* x, S* sine, S* cosine);
  void (*fma)(const S* a, const S* b, const S* c, S* result);   ///< a b + c
  void (*fnma)(const S* a, const S* b, const S* c, S* result);  ///< c - a b
  void (*arithmetic)(const S* a, const S* b, S* result);        ///< -((a + b) * (a - b)) / b
  void (*sqrt)(const S* a, S* result);
  void (*select_less)(const S* a, const S* b, const S* yes, const S* no, S* result);  ///< a < b ? yes : no
  void (*beyond)(const S* a, const S* bound, bool* result);
  void (*farther)(const S* most, const S* a, S* result);
  bool (*any_less)(const S* a, const S* b);
  void (*masks)(const S* a, const S* b, bool* both, bool* either, bool* neither);  ///< of a < 0 and b < 0
};

extern const Operations<float> avx2_f32, avx2_scalar_f32, avx512_f32;
extern const Operations<double> avx2_f64, avx2_scalar_f64, avx512_f64;
extern const Operations<float> neon_f32, neon_scalar_f32;
extern const Operations<double> neon_f64, neon_scalar_f64;

template <class T>
struct Wrapped {
  using S = typename T::Scalar;

  static T get(const S* p) {
    alignas(64) S aligned[T::lanes];
    for (int i = 0; i < T::lanes; ++i) aligned[i] = p[i];
    return T::load(aligned);
  }
  static void put(T value, S* p) {
    alignas(64) S aligned[T::lanes];
    store(aligned, value);
    for (int i = 0; i < T::lanes; ++i) p[i] = aligned[i];
  }
  static void put(typename T::Mask mask, bool* p) {
    for (int i = 0; i < T::lanes; ++i) p[i] = lane(mask, i);
  }

  static void sincos_of(const S* x, S* sine, S* cosine) {
    T s, c;
    sincos(get(x), s, c);
    put(s, sine), put(c, cosine);
  }
  static void fma_of(const S* a, const S* b, const S* c, S* result) { put(fma(get(a), get(b), get(c)), result); }
  static void fnma_of(const S* a, const S* b, const S* c, S* result) { put(fnma(get(a), get(b), get(c)), result); }
  static void arithmetic_of(const S* a, const S* b, S* result) {
    put(-((get(a) + get(b)) * (get(a) - get(b))) / get(b), result);
  }
  static void sqrt_of(const S* a, S* result) { put(sqrt(get(a)), result); }
  static void select_less_of(const S* a, const S* b, const S* yes, const S* no, S* result) {
    put(select(less(get(a), get(b)), get(yes), get(no)), result);
  }
  static void beyond_of(const S* a, const S* bound, bool* result) { put(beyond(get(a), get(bound)), result); }
  static void farther_of(const S* most, const S* a, S* result) { put(farther(get(most), get(a)), result); }
  static bool any_less_of(const S* a, const S* b) { return any(less(get(a), get(b))); }
  static void masks_of(const S* a, const S* b, bool* both, bool* either, bool* neither) {
    const auto left = less(get(a), T(S(0))), right = less(get(b), T(S(0)));
    put(left & right, both), put(left | right, either), put(~(left | right), neither);
  }
};

template <class S, int W, class Arithmetic>
constexpr Operations<S> operations(const char* name) {
  using Own = Wrapped<simd::Wide<S, W, Arithmetic>>;
  return {name,
          W,
          Arithmetic::fused,
          Own::sincos_of,
          Own::fma_of,
          Own::fnma_of,
          Own::arithmetic_of,
          Own::sqrt_of,
          Own::select_less_of,
          Own::beyond_of,
          Own::farther_of,
          Own::any_less_of,
          Own::masks_of};
}

}  // namespace lockstep::simd_test
