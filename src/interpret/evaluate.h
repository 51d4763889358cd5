// What each arithmetic operation of the interpreter computes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "operations.h"
#include "simd/wide.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE typename T::Mask mask_of(const T& number) {
  return {bits(number)};
}
template <class T>
LOCKSTEP_INLINE T number_from(typename T::Mask mask) {
  return T::from_bits(mask.bits);
}

template <Opcode opcode, class T>
LOCKSTEP_INLINE T evaluate([[maybe_unused]] T a, [[maybe_unused]] T b, [[maybe_unused]] T c) {
  switch (opcode) {
    case Opcode::copy:
    case Opcode::fill: return a;
    case Opcode::negate: return -a;
    case Opcode::sqrt: return sqrt(a);
    case Opcode::invert: return number_from<T>(~mask_of(a));
    case Opcode::add:
    case Opcode::add_constant: return a + b;
    case Opcode::subtract:
    case Opcode::subtract_from_constant: return a - b;
    case Opcode::multiply:
    case Opcode::multiply_constant: return a * b;
    case Opcode::divide: return a / b;
    case Opcode::farther: return farther(a, b);
    case Opcode::less: return number_from<T>(less(a, b));
    case Opcode::beyond:
    case Opcode::beyond_constant: return number_from<T>(beyond(b, a));
    case Opcode::either: return number_from<T>(mask_of(a) | mask_of(b));
    case Opcode::both: return number_from<T>(mask_of(a) & mask_of(b));
    case Opcode::fma:
    case Opcode::fma_constant: return fma(a, b, c);
    case Opcode::fnma:
    case Opcode::fnma_constant: return fnma(a, b, c);
    case Opcode::fms: return fma(a, b, -c);
    case Opcode::select: return select(mask_of(a), b, c);
    case Opcode::fill_rounding: return T::rounding();
    default: __builtin_unreachable();
  }
}

}  // namespace lockstep::kernels
