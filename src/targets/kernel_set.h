// KernelSet: the kernels of one instruction set, as plain functions. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "jit/frame.h"
#include "kernels/readback.h"

namespace lockstep {

template <class S>
struct KernelSet {
  int lanes;
  /// Bytes of scratch memory that the functions below need for these tables. It is aligned to 64 bytes.
  std::size_t (*scratch_bytes)(const Tables<S>&);
  /// Steps environments [first, last), which are whole tiles.
  void (*advance)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, std::ptrdiff_t last, int substeps,
                  void* scratch);
  /// The same by machine code, whose tiles need scratch memory for their slots too.
  void (*advance_by_code)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, std::ptrdiff_t last,
                          int substeps, void* scratch, const jit::StepCode&);
  /// Where a tile's numbers stand, for machine code.
  void (*find_places)(const Tables<S>&, jit::TilePlaces&);
  void (*read)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, std::ptrdiff_t last,
               const kernels::Request<S>&, S* rows, std::ptrdiff_t stride, void* scratch);
  /// Frames of one tile: kernels::frame_numbers rows of `lanes` numbers for each request.
  void (*read_frames)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, const kernels::Request<S>*,
                      int count, S* numbers, void* scratch);
  /// The same of a plan that records accelerations: kernels::acceleration_numbers rows.
  void (*read_accelerations)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first,
                             const kernels::Request<S>*, int count, S* numbers, void* scratch);
  /// Contacts of one tile: kernels::contact_numbers rows of `lanes` numbers for each slot, and one more row.
  void (*read_contacts)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t first, S* numbers, void* scratch);
  /// Heights of one tile above the ground, about a frame of read_frames(): `lanes` numbers for each point x, y.
  void (*scan_heights)(const Tables<S>&, const StatePointers<S>&, const S* frame, const S* points, int count,
                       S* numbers, void* scratch);
};

// Each is compiled for its instruction set: avx2 and avx512 on x86-64, neon on AArch64.
extern const KernelSet<float> baseline_f32, avx2_f32, avx512_f32, neon_f32;
extern const KernelSet<double> baseline_f64, avx2_f64, avx512_f64, neon_f64;

}  // namespace lockstep
