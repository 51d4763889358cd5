// KernelSet: what one instruction set offers, as plain functions. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "interpret/operations.h"
#include "kernels/readback.h"

namespace lockstep {

template <class S>
struct KernelSet {
  int lanes;
  /// Bytes of scratch memory, aligned to 64, that the functions below want for these tables.
  std::size_t (*scratch_bytes)(const Tables<S>&);
  /// Environments [first, last): whole tiles.
  void (*advance)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, std::ptrdiff_t last, int substeps,
                  void* scratch);
  /// The same by the interpreter, and the memory for that.
  std::size_t (*interpreter_bytes)(const Tables<S>&, const OperationList&);
  void (*interpret)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, std::ptrdiff_t last, int substeps,
                    void* scratch, const OperationList&);
  void (*read)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, std::ptrdiff_t last,
               const kernels::Request<S>&, S* rows, std::ptrdiff_t stride, void* scratch);
};

// Compiled for each instruction set by itself; avx ones on x86-64, neon on AArch64.
extern const KernelSet<float> baseline_f32, avx2_f32, avx512_f32, neon_f32;
extern const KernelSet<double> baseline_f64, avx2_f64, avx512_f64, neon_f64;

}  // namespace lockstep
