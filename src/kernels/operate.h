// What the operations of a list make of their numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../plan/operations.h"
#include "../simd/wide.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE typename T::Mask mask_of(const T& number) {
  return {bits(number)};
}
template <class T>
LOCKSTEP_INLINE T number_from(typename T::Mask mask) {
  return T::from_bits(mask.bits);
}

template <Does does, class T>
LOCKSTEP_INLINE T made_of([[maybe_unused]] T a, [[maybe_unused]] T b, [[maybe_unused]] T c) {
  switch (does) {
    case Does::copy:
    case Does::fill: return a;
    case Does::negate: return -a;
    case Does::sqrt: return sqrt(a);
    case Does::invert: return number_from<T>(~mask_of(a));
    case Does::add:
    case Does::add_constant: return a + b;
    case Does::subtract:
    case Does::subtract_from_constant: return a - b;
    case Does::multiply:
    case Does::multiply_constant: return a * b;
    case Does::divide: return a / b;
    case Does::farther: return farther(a, b);
    case Does::less: return number_from<T>(less(a, b));
    case Does::beyond:
    case Does::beyond_constant: return number_from<T>(beyond(b, a));
    case Does::either: return number_from<T>(mask_of(a) | mask_of(b));
    case Does::both: return number_from<T>(mask_of(a) & mask_of(b));
    case Does::fma:
    case Does::fma_constant: return fma(a, b, c);
    case Does::fnma:
    case Does::fnma_constant: return fnma(a, b, c);
    case Does::fms: return fma(a, b, -c);
    case Does::select: return select(mask_of(a), b, c);
    case Does::fill_rounding: return T::rounding();
    default: __builtin_unreachable();
  }
}

}  // namespace lockstep::kernels
