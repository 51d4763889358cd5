// Functions of one number with their first two derivatives, without branches: (M135) to (M137).
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sincos.h"

namespace lockstep::simd {

/// A function at a point.
template <class T>
struct Curve {
  T value, slope, bend;  ///< f, f', f''
};

/// (M135) Horner's rule for c_0 + c_1 x + ... with `count` coefficients.
template <class T>
LOCKSTEP_INLINE Curve<T> polynomial(const T* c, int count, T x) {
  Curve<T> f{c[count - 1], T(0), T(0)};
  for (int k = count - 2; k >= 0; --k) {
    f.bend = fma(f.bend, x, f.slope);
    f.slope = fma(f.slope, x, f.value);
    f.value = fma(f.value, x, c[k]);
  }
  f.bend += f.bend;
  return f;
}

constexpr int numbers_of_piece = 4;

/// (M136) The pieces of the natural cubic spline through `count` points (knot, y): four coefficients for each, of the
/// powers of the distance from its knot. The last one is the straight line beyond the last knot.
template <class S, class T>
LOCKSTEP_INLINE void spline_pieces(const S* knot, int count, const T* y, T* piece) {
  const auto of = [&](int i, int k) LOCKSTEP_INLINED -> T& { return piece[numbers_of_piece * i + k]; };
  const auto gap = [&](int i) LOCKSTEP_INLINED { return knot[i + 1] - knot[i]; };
  const auto chord = [&](int i) LOCKSTEP_INLINED { return (y[i + 1] - y[i]) * T(S(1) / gap(i)); };

  // Second derivatives at the knots, by elimination of the tridiagonal system: upwards, then downwards.
  S pivot = S(0);
  of(0, 2) = of(0, 3) = of(count - 1, 2) = of(count - 1, 3) = T(0);
  for (int i = 1; i < count - 1; ++i) {
    const S left = i > 1 ? gap(i - 1) : S(0), factor = i > 1 ? left / pivot : S(0);
    pivot = S(2) * (gap(i - 1) + gap(i)) - factor * left;
    of(i, 2) = fma(T(-factor), of(i - 1, 2), T(S(6)) * (chord(i) - chord(i - 1)));
    of(i, 3) = T(S(1) / pivot);
  }
  for (int i = count - 2; i > 0; --i) of(i, 2) = fma(T(-gap(i)), of(i + 1, 2), of(i, 2)) * of(i, 3);

  // The pieces, and the line that goes on from the last one.
  for (int i = 0; i < count - 1; ++i) {
    const T one = of(i, 2), other = of(i + 1, 2), sixth = T(S(1) / S(6)), h = T(gap(i));
    of(i, 0) = y[i];
    of(i, 1) = fma(-(h * sixth), one + one + other, chord(i));
    of(i, 3) = (other - one) * (sixth * T(S(1) / gap(i)));
  }
  const int last = count - 1;
  of(last, 0) = y[last];
  of(last, 1) = fma(T(gap(last - 1) / S(6)), of(last - 1, 2), chord(last - 1));
  for (int i = 0; i < last; ++i) of(i, 2) *= T(S(0.5));
}

/// A piece at a distance from its knot.
template <class T>
LOCKSTEP_INLINE Curve<T> cubic(const T* c, T x) {
  return polynomial(c, numbers_of_piece, x);
}

/// (M136) The spline at x: of the pieces whose knots are below, the last one; below all of them, the first one's
/// tangent.
template <class S, class T>
LOCKSTEP_INLINE Curve<T> spline(const S* knot, const T* piece, int count, T x) {
  T own[numbers_of_piece] = {piece[0], piece[1], T(0), T(0)}, from = T(knot[0]);
  for (int i = 0; i < count; ++i) {
    const auto beyond_knot = ~less(x, T(knot[i]));
    from = select(beyond_knot, T(knot[i]), from);
    for (int k = 0; k < numbers_of_piece; ++k) own[k] = select(beyond_knot, piece[numbers_of_piece * i + k], own[k]);
  }
  return cubic(own, x - from);
}

/// (M137) mean + cosine cos(rate x) + sine sin(rate x).
template <class T>
LOCKSTEP_INLINE Curve<T> harmonic(T mean, T cosine, T sine, T rate, T x) {
  T s, c;
  sincos(rate * x, s, c);
  const T swing = fma(cosine, c, sine * s), slope = rate * fma(-cosine, s, sine * c);
  return {mean + swing, slope, -(rate * rate * swing)};
}

}  // namespace lockstep::simd
