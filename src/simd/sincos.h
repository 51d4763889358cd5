// Sine and cosine together, without branches. SPDX-License-Identifier: Apache-2.0
//
// Reduction to [-pi/4, pi/4] by pi/2 in three parts (Cody and Waite 1980), then the minimax polynomials of Cephes
// (Moshier 1992). The largest error is 1e-7 in float for |x| < 8192, and 3e-16 in double for |x| < 1e6. Beyond, the
// reduction loses digits in proportion to x.
#pragma once

#include "wide.h"

namespace lockstep::simd {

template <class S>
struct SincosConstants;

template <>
struct SincosConstants<float> {
  static constexpr float round = 12582912.0f;  // 1.5 * 2^23: adding it rounds to an integer in the low bits
  static constexpr float half_pi[3] = {1.5703125f, 4.837512969970703125e-4f, 7.5497899548918821e-8f};
  static constexpr int terms = 3;
  static constexpr float sine[3] = {-1.9515295891e-4f, 8.3321608736e-3f, -1.6666654611e-1f};
  static constexpr float cosine[3] = {2.443315711809948e-5f, -1.388731625493765e-3f, 4.166664568298827e-2f};
};

template <>
struct SincosConstants<double> {
  static constexpr double round = 6755399441055744.0;  // 1.5 * 2^52
  static constexpr double half_pi[3] = {2 * 7.85398125648498535156e-1, 2 * 3.77489470793079817668e-8,
                                        2 * 2.69515142907905952645e-15};
  static constexpr int terms = 6;
  static constexpr double sine[6] = {1.58962301576546568060e-10, -2.50507477628578072866e-8,
                                     2.75573136213857245213e-6,  -1.98412698295895385996e-4,
                                     8.33333333332211858878e-3,  -1.66666666666666307295e-1};
  static constexpr double cosine[6] = {-1.13585365213876817300e-11, 2.08757008419747316778e-9,
                                       -2.75573141792967388112e-7,  2.48015872888517045348e-5,
                                       -1.38888888888730564116e-3,  4.16666666666665929218e-2};
};

/// Operations of one sincos(): 10 for the reduction, two polynomials, 11 for their last terms.
template <class S>
inline constexpr int sincos_flops = 10 + 4 * (SincosConstants<S>::terms - 1) + 11;

/// The state of both polynomials, between reduction and result.
template <class T>
struct Turning {
  using C = SincosConstants<typename T::Scalar>;
  T r, z, s, c;
  typename T::Bits quadrant;

  LOCKSTEP_INLINE explicit Turning(T x) : r(x), s(C::sine[0]), c(C::cosine[0]) {
    const T shifted = fma(x, T(typename T::Scalar(0.636619772367581343)), T(C::round));
    quadrant = bits(shifted);
    const T turns = shifted - T(C::round);
    for (int i = 0; i < 3; ++i) r = fnma(T(C::half_pi[i]), turns, r);
    z = r * r;
  }
  LOCKSTEP_INLINE void add_term(int i) {
    s = fma(s, z, T(C::sine[i]));
    c = fma(c, z, T(C::cosine[i]));
  }
  LOCKSTEP_INLINE void end(T& sine, T& cosine) {
    s = fma(s * z, r, r);
    c = fma(z * z, c, fnma(T(typename T::Scalar(0.5)), z, T(typename T::Scalar(1))));
    // Bit 0 of the quadrant swaps the two. Bit 1 flips the sign of the sine, bit 0 xor bit 1 that of the cosine.
    constexpr int top = 8 * sizeof(typename T::Scalar) - 1;
    const typename T::Bits sign = (typename T::Bits{} + 1) << top;
    const typename T::Bits odd = quadrant << top, sine_sign = (quadrant << (top - 1)) & sign;
    const typename T::Bits swap = (bits(s) ^ bits(c)) & (odd >> top);
    sine = T::from_bits(bits(s) ^ swap ^ sine_sign);
    cosine = T::from_bits(bits(c) ^ swap ^ odd ^ sine_sign);
  }
};

template <class S, int W, class A>
LOCKSTEP_INLINE void sincos(Wide<S, W, A> x, Wide<S, W, A>& sine, Wide<S, W, A>& cosine) {
  Turning<Wide<S, W, A>> turning(x);
  for (int i = 1; i < SincosConstants<S>::terms; ++i) turning.add_term(i);
  turning.end(sine, cosine);
}

/// Four side by side: one alone would wait for each of its terms.
template <class S, int W, class A>
LOCKSTEP_INLINE void sincos_of_four(const Wide<S, W, A>* x, Wide<S, W, A>* sine, Wide<S, W, A>* cosine) {
  using One = Turning<Wide<S, W, A>>;
  One turning[4] = {One(x[0]), One(x[1]), One(x[2]), One(x[3])};
#pragma GCC unroll 8
  for (int i = 1; i < SincosConstants<S>::terms; ++i)
#pragma GCC unroll 4
    for (One& one : turning) one.add_term(i);
#pragma GCC unroll 4
  for (int k = 0; k < 4; ++k) turning[k].end(sine[k], cosine[k]);
}

}  // namespace lockstep::simd
