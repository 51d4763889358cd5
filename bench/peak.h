// What this machine can do at best, measured. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep::bench {

/// CPU time of the calling thread, s.
double cpu_seconds();

/// Independent chains of fused multiply-adds in registers, on one core.
enum class Peak { avx2_f32, avx2_f64, avx512_f32, avx512_f64 };
inline constexpr Peak all_peaks[] = {Peak::avx2_f32, Peak::avx2_f64, Peak::avx512_f32, Peak::avx512_f64};

const char* to_string(Peak peak);
bool supported(Peak peak);  ///< by this machine

/// Flops of running that many rounds of the chains, a multiply-add counted as two.
double run_peak(Peak peak, long rounds);

/// Gflop/s of CPU time over about `seconds`; 0 where the machine has no such instructions.
double measured_peak(Peak peak, double seconds = 0.02);

/// Arrays of so many numbers; pass() takes a = b + s c over them and returns the bytes moved.
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
