// The processor that code is made for. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep::jit {

struct Machine {
  int scalar_bytes;    ///< 4 or 8
  int register_bytes;  ///< 32: AVX2, 64: AVX-512
  int registers;       ///< that code may use, at least 3
  int window = 0;      ///< operations among which the next one is chosen (schedule.h); 0: they keep their order
  int longest = 0;     ///< operations of a step that is one part; longer steps are cut
  int part = 0;        ///< operations of a part
  int tiles = 1;       ///< that go through the parts together

  bool avx512() const { return register_bytes == 64; }
  /// AVX-512 reads a constant into all lanes by itself.
  int constant_bytes() const { return avx512() ? scalar_bytes : register_bytes; }
  bool has_larger() const { return avx512() || scalar_bytes == 4; }
};

/// As measured to be best (docs/notes/tried.md).
inline Machine machine_for(bool avx512, int scalar_bytes) {
  return {scalar_bytes, avx512 ? 64 : 32, avx512 ? 32 : 16, avx512 ? 16 : 0, avx512 ? 4000 : 3000, 300, 2};
}

}  // namespace lockstep::jit
