// Wide<S, W, Arithmetic>: W numbers in one register, one per environment. SPDX-License-Identifier: Apache-2.0
//
// A struct over the compiler's vector extension. Arithmetic says whether fma() rounds once (Fused) or twice (Unfused).
// All other operations round alike everywhere, so any W gives the same bits. Arithmetic also keeps the instantiations
// for different instruction sets apart: the linker cannot take one for another.
#pragma once

#include <cstddef>
#include <cstdint>

#define LOCKSTEP_INLINE inline __attribute__((always_inline))
#define LOCKSTEP_INLINED __attribute__((always_inline))  // the same for lambdas

namespace lockstep::simd {

struct Fused {
  static constexpr bool fused = true;
};
struct Unfused {
  static constexpr bool fused = false;
};

template <class S>
struct IntegerOf;
template <>
struct IntegerOf<float> {
  using type = std::int32_t;
};
template <>
struct IntegerOf<double> {
  using type = std::int64_t;
};

template <class S, int W>
struct VectorOf {
  typedef S type __attribute__((vector_size(W * sizeof(S)), may_alias));
};

/// Whether any bit is set, in a vector of 16 bytes or a multiple, which has an instruction or two for this.
template <class Bits>
LOCKSTEP_INLINE bool any_bit(const Bits& bits) {
  using Half = typename VectorOf<long long, sizeof(Bits) / 16>::type;
  struct Halves {
    Half low, high;
  };
  const auto either = [&]() LOCKSTEP_INLINED {
    const Halves halves = __builtin_bit_cast(Halves, bits);
    return halves.low | halves.high;
  };
#ifdef __AVX__
  using Four = VectorOf<long long, 4>::type;
  if constexpr (sizeof(Bits) == 32) return !__builtin_ia32_ptestz256((Four)bits, (Four)bits);
#elif defined(__SSE2__)
  using Sixteen = VectorOf<char, 16>::type;
  if constexpr (sizeof(Bits) == 16) return __builtin_ia32_pmovmskb128((Sixteen)bits) != 0;
#endif
  if constexpr (sizeof(Bits) > 16) return any_bit(either());
  return either()[0] != 0;
}

template <class S, int W, class Arithmetic>
struct Wide {
  using Scalar = S;
  using Integer = typename IntegerOf<S>::type;
  static constexpr int lanes = W;
  static constexpr bool fused = Arithmetic::fused;
  using Vector = typename VectorOf<S, W>::type;
  using Bits = typename VectorOf<Integer, W>::type;
  struct Mask {
    Bits bits;  // all ones in the lanes where it is true
    LOCKSTEP_INLINE bool lane(int i) const { return bits[i] != 0; }
    LOCKSTEP_INLINE void set_lane(int i, bool value) { bits[i] = value ? -1 : 0; }
  };

  Vector v;

  LOCKSTEP_INLINE Wide() = default;
  LOCKSTEP_INLINE Wide(Vector vector) : v(vector) {}
  LOCKSTEP_INLINE Wide(S scalar) : v(scalar - Vector{}) {}

  LOCKSTEP_INLINE friend Wide operator+(Wide a, Wide b) { return a.v + b.v; }
  LOCKSTEP_INLINE friend Wide operator-(Wide a, Wide b) { return a.v - b.v; }
  LOCKSTEP_INLINE friend Wide operator*(Wide a, Wide b) { return a.v * b.v; }
  LOCKSTEP_INLINE friend Wide operator/(Wide a, Wide b) { return a.v / b.v; }
  LOCKSTEP_INLINE friend Wide operator-(Wide a) { return -a.v; }
  LOCKSTEP_INLINE Wide& operator+=(Wide b) { return *this = *this + b; }
  LOCKSTEP_INLINE Wide& operator-=(Wide b) { return *this = *this - b; }
  LOCKSTEP_INLINE Wide& operator*=(Wide b) { return *this = *this * b; }

  // a b + c
  LOCKSTEP_INLINE friend Wide fma(Wide a, Wide b, Wide c) {
    if constexpr (!Arithmetic::fused) {
      return a.v * b.v + c.v;
    } else {
#ifdef __FMA__
      if constexpr (sizeof(Vector) == 32 && sizeof(S) == 4) return __builtin_ia32_vfmaddps256(a.v, b.v, c.v);
      if constexpr (sizeof(Vector) == 32 && sizeof(S) == 8) return __builtin_ia32_vfmaddpd256(a.v, b.v, c.v);
#endif
#ifdef __AVX512F__
      constexpr int all = -1, current_rounding = 4;
      if constexpr (sizeof(Vector) == 64 && sizeof(S) == 4)
        return __builtin_ia32_vfmaddps512_mask(a.v, b.v, c.v, all, current_rounding);
      if constexpr (sizeof(Vector) == 64 && sizeof(S) == 8)
        return __builtin_ia32_vfmaddpd512_mask(a.v, b.v, c.v, all, current_rounding);
#endif
#ifdef __aarch64__
      if constexpr (sizeof(Vector) == 16 && sizeof(S) == 4) return __builtin_aarch64_fmav4sf(a.v, b.v, c.v);
      if constexpr (sizeof(Vector) == 16 && sizeof(S) == 8) return __builtin_aarch64_fmav2df(a.v, b.v, c.v);
#endif
      Wide result;
      for (int i = 0; i < W; ++i) {
        if constexpr (sizeof(S) == 4) result.v[i] = __builtin_fmaf(a.v[i], b.v[i], c.v[i]);
        if constexpr (sizeof(S) == 8) result.v[i] = __builtin_fma(a.v[i], b.v[i], c.v[i]);
      }
      return result;
    }
  }
  // c - a b
  LOCKSTEP_INLINE friend Wide fnma(Wide a, Wide b, Wide c) { return fma(-a, b, c); }

  LOCKSTEP_INLINE friend Wide sqrt(Wide a) {
    Wide result;
    for (int i = 0; i < W; ++i) {
      if constexpr (sizeof(S) == 4) result.v[i] = __builtin_sqrtf(a.v[i]);
      if constexpr (sizeof(S) == 8) result.v[i] = __builtin_sqrt(a.v[i]);
    }
    return result;
  }

  LOCKSTEP_INLINE friend Bits bits(Wide a) { return (Bits)a.v; }
  LOCKSTEP_INLINE static Wide from_bits(Bits b) { return (Vector)b; }

  LOCKSTEP_INLINE friend Mask less(Wide a, Wide b) { return {(Bits)(a.v < b.v)}; }
  // |a| > bound. This compares integers, so it is true for NaN whatever the compiler assumes about NaN.
  LOCKSTEP_INLINE friend Mask beyond(Wide a, Wide bound) { return {(Bits)(magnitude(a) > (Bits)bound.v)}; }
  // The larger of |a| and `most`, which is not negative, in the order of beyond().
  LOCKSTEP_INLINE friend Wide farther(Wide most, Wide a) {
    const Bits own = magnitude(a), other = (Bits)most.v;
    return from_bits(own > other ? own : other);
  }
  LOCKSTEP_INLINE friend Bits magnitude(Wide a) {
    return (Bits)a.v & (Bits{} + Integer(~(Integer(1) << (8 * sizeof(S) - 1))));
  }
  LOCKSTEP_INLINE friend Wide select(Mask m, Wide yes, Wide no) { return m.bits ? yes.v : no.v; }
  LOCKSTEP_INLINE friend Mask operator|(Mask a, Mask b) { return {a.bits | b.bits}; }
  LOCKSTEP_INLINE friend Mask operator&(Mask a, Mask b) { return {a.bits & b.bits}; }
  LOCKSTEP_INLINE friend Mask operator~(Mask a) { return {~a.bits}; }
  LOCKSTEP_INLINE friend bool lane(Mask m, int i) { return m.lane(i); }
  LOCKSTEP_INLINE friend bool any(Mask m) {
    if constexpr (sizeof(Bits) >= 16) return any_bit(m.bits);
    Integer all = 0;
    for (int i = 0; i < W; ++i) all |= m.bits[i];
    return all != 0;
  }
  LOCKSTEP_INLINE static Mask none() { return {Bits{}}; }

  // Towards 0, for numbers that fit into Integer.
  LOCKSTEP_INLINE friend Bits integers(Wide a) { return __builtin_convertvector(a.v, Bits); }
  LOCKSTEP_INLINE friend Wide truncated(Wide a) { return __builtin_convertvector(integers(a), Vector); }
  // table[index], by lane.
  LOCKSTEP_INLINE friend Wide gather(const S* table, Wide index) {
    const Bits at = integers(index);
    Wide result;
    for (int i = 0; i < W; ++i) result.v[i] = table[at[i]];
    return result;
  }

  /// One unit in the last place of 1, or a little more.
  LOCKSTEP_INLINE static Wide rounding() { return by_precision(1.2e-7, 2.3e-16); }
  /// A number for f32 and one for f64.
  LOCKSTEP_INLINE static Wide by_precision(double single, double twice) { return S(sizeof(S) == 4 ? single : twice); }

  LOCKSTEP_INLINE S lane(int i) const { return v[i]; }
  LOCKSTEP_INLINE void set_lane(int i, S value) { v[i] = value; }

  LOCKSTEP_INLINE static Wide load(const S* p) { return *reinterpret_cast<const Vector*>(p); }
  LOCKSTEP_INLINE friend void store(S* p, Wide a) { *reinterpret_cast<Vector*>(p) = a.v; }
};

// The scalar type of a wide type: what the tables hold.
template <class T>
using ScalarOf = typename T::Scalar;

}  // namespace lockstep::simd
