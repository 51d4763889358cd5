// Measures the peak of this machine. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cpu_seconds.h"

namespace lockstep::bench {

/// Peaks of fused multiply-adds on one core: independent chains of them in registers.
enum class Peak { avx2_f32, avx2_f64, avx512_f32, avx512_f64 };
inline constexpr Peak all_peaks[] = {Peak::avx2_f32, Peak::avx2_f64, Peak::avx512_f32, Peak::avx512_f64};

const char* to_string(Peak peak);
bool supported(Peak peak);  ///< by this machine

/// Runs this many rounds of the chains and returns their flops. A multiply-add counts as two.
double run_peak(Peak peak, long rounds);

/// Gflop/s of CPU time, measured for about `seconds`; 0 if the machine does not have the instructions.
double measured_peak(Peak peak, double seconds = 0.02);

/// Three arrays of this many numbers. pass() computes a = b + s c and returns the bytes that it moves.
class Stream {
 public:
  explicit Stream(long floats);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  double pass();

 private:
  long floats_;
  float *a_, *b_, *c_;
};

}  // namespace lockstep::bench
