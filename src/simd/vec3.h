// Small spatial algebra on wide numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "wide.h"

namespace lockstep::simd {

// Three members that are assigned one by one. Otherwise the compiler would copy the struct through memory in halves of
// a register, and a load of a whole register would wait for both.
template <class T>
struct Vec3 {
  T x, y, z;

  LOCKSTEP_INLINE Vec3() = default;
  LOCKSTEP_INLINE Vec3(T a, T b, T c) : x(a), y(b), z(c) {}
  LOCKSTEP_INLINE Vec3(const Vec3& other) : x(other.x), y(other.y), z(other.z) {}
  LOCKSTEP_INLINE Vec3& operator=(const Vec3& other) {
    x = other.x;
    y = other.y;
    z = other.z;
    return *this;
  }
  LOCKSTEP_INLINE T& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
  LOCKSTEP_INLINE const T& operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
  LOCKSTEP_INLINE friend Vec3 operator+(const Vec3& a, const Vec3& b) {
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
  }
  LOCKSTEP_INLINE friend Vec3 operator-(const Vec3& a, const Vec3& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  }
  LOCKSTEP_INLINE static Vec3 zero() { return {T(0), T(0), T(0)}; }
  LOCKSTEP_INLINE static Vec3 constant(const ScalarOf<T>* s) { return {T(s[0]), T(s[1]), T(s[2])}; }
};

// act(0), act(1), act(2). What a loop indexes, the compiler would put into memory.
template <class Act>
LOCKSTEP_INLINE void each_axis(Act&& act) {
  act(0);
  act(1);
  act(2);
}

// a s + b
template <class T>
LOCKSTEP_INLINE Vec3<T> fma(const Vec3<T>& a, T s, const Vec3<T>& b) {
  return {fma(a[0], s, b[0]), fma(a[1], s, b[1]), fma(a[2], s, b[2])};
}

template <class T>
LOCKSTEP_INLINE Vec3<T> scaled(const Vec3<T>& a, T s) {
  return {a.x * s, a.y * s, a.z * s};
}

template <class T>
LOCKSTEP_INLINE T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]));
}

// a x b + c
template <class T>
LOCKSTEP_INLINE Vec3<T> cross_add(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c) {
  return {fma(a[1], b[2], fnma(a[2], b[1], c[0])), fma(a[2], b[0], fnma(a[0], b[2], c[1])),
          fma(a[0], b[1], fnma(a[1], b[0], c[2]))};
}

template <class T>
LOCKSTEP_INLINE Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {fnma(a[2], b[1], a[1] * b[2]), fnma(a[0], b[2], a[2] * b[0]), fnma(a[1], b[0], a[0] * b[1])};
}

// 3x3, by rows.
template <class T>
struct Mat3 {
  Vec3<T> x, y, z;
  LOCKSTEP_INLINE T& operator()(int r, int c) { return r == 0 ? x[c] : r == 1 ? y[c] : z[c]; }
  LOCKSTEP_INLINE const T& operator()(int r, int c) const { return r == 0 ? x[c] : r == 1 ? y[c] : z[c]; }
  LOCKSTEP_INLINE static Mat3 constant(const ScalarOf<T>* s) {
    return {Vec3<T>::constant(s), Vec3<T>::constant(s + 3), Vec3<T>::constant(s + 6)};
  }
};

template <class T>
LOCKSTEP_INLINE Vec3<T> column_of(const Mat3<T>& m, int k) {
  return {m(0, k), m(1, k), m(2, k)};
}

// M a + b
template <class T>
LOCKSTEP_INLINE Vec3<T> multiply_add(const Mat3<T>& m, const Vec3<T>& a, const Vec3<T>& b) {
  const auto row = [&](int i) { return fma(m(i, 0), a.x, fma(m(i, 1), a.y, fma(m(i, 2), a.z, b[i]))); };
  return {row(0), row(1), row(2)};
}

template <class T>
LOCKSTEP_INLINE Vec3<T> multiply(const Mat3<T>& m, const Vec3<T>& a) {
  const auto row = [&](int i) { return fma(m(i, 0), a.x, fma(m(i, 1), a.y, m(i, 2) * a.z)); };
  return {row(0), row(1), row(2)};
}

template <class T>
LOCKSTEP_INLINE Mat3<T> product(const Mat3<T>& a, const Mat3<T>& b) {
  Mat3<T> result;
  for (int c = 0; c < 3; ++c) {
    const Vec3<T> column = multiply(a, column_of(b, c));
    for (int r = 0; r < 3; ++r) result(r, c) = column[r];
  }
  return result;
}

template <class T>
LOCKSTEP_INLINE Vec3<T> multiply_transposed(const Mat3<T>& m, const Vec3<T>& a) {
  const auto row = [&](int i) { return fma(m(0, i), a.x, fma(m(1, i), a.y, m(2, i) * a.z)); };
  return {row(0), row(1), row(2)};
}

// An entry of a symmetric matrix that is stored as xx, yy, zz, yz, xz, xy, so that entry 3 + k belongs to the two axes
// other than k.
template <class T>
LOCKSTEP_INLINE T pair(const T* symmetric, int i, int j) {
  return i == j ? symmetric[i] : symmetric[6 - i - j];
}

// A body's mass, first moment h = m c and second moment about the origin of its frame. The second moment is the
// integral of p p^T dm (the pseudo-inertia of Balafoutis and Patel 1991).
template <class T>
struct PseudoInertia {
  T mass;
  Vec3<T> moment;
  T second[6];

  LOCKSTEP_INLINE T pair(int i, int j) const { return simd::pair(second, i, j); }
};

// The inertia of a body and of all that it carries, with their joints free to move (Featherstone 1983), about its
// origin: moment = angular alpha + across a, force = across^T alpha + linear a.
template <class T>
struct ArticulatedInertia {
  T angular[6];
  Mat3<T> across;
  T linear[6];
};

}  // namespace lockstep::simd
