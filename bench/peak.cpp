// SPDX-License-Identifier: Apache-2.0
//
// Each function is compiled for the instructions that it measures, so the file needs no compiler flags. Four cycles of
// latency times two units need eight chains. There are twelve, which fit sixteen registers with their two constants.
#include "peak.h"

#include <immintrin.h>

#include <algorithm>

namespace lockstep::bench {
namespace {

constexpr int chains = 12, unrolled = 8;
volatile float sink;

#define LOCKSTEP_PEAK(NAME, FEATURES, VECTOR, SCALAR, SET, FMADD)                                             \
  __attribute__((target(FEATURES))) void NAME(long rounds) {                                                  \
    VECTOR chain[chains];                                                                                     \
    for (int i = 0; i < chains; ++i) chain[i] = SET(SCALAR(1 + i));                                           \
    const VECTOR factor = SET(SCALAR(0.999999)), term = SET(SCALAR(1e-6));                                    \
    for (long r = 0; r < rounds; ++r)                                                                         \
      _Pragma("GCC unroll 8") for (int u = 0; u < unrolled; ++u)                                              \
          _Pragma("GCC unroll 12") for (int i = 0; i < chains; ++i) chain[i] = FMADD(chain[i], factor, term); \
    VECTOR sum = chain[0];                                                                                    \
    for (int i = 1; i < chains; ++i) sum = FMADD(sum, factor, chain[i]);                                      \
    sink = float(sum[0]);                                                                                     \
  }

LOCKSTEP_PEAK(chains_avx2_f32, "avx2,fma", __m256, float, _mm256_set1_ps, _mm256_fmadd_ps)
LOCKSTEP_PEAK(chains_avx2_f64, "avx2,fma", __m256d, double, _mm256_set1_pd, _mm256_fmadd_pd)
LOCKSTEP_PEAK(chains_avx512_f32, "avx512f", __m512, float, _mm512_set1_ps, _mm512_fmadd_ps)
LOCKSTEP_PEAK(chains_avx512_f64, "avx512f", __m512d, double, _mm512_set1_pd, _mm512_fmadd_pd)
#undef LOCKSTEP_PEAK

struct Kind {
  const char* name;
  void (*run)(long rounds);
  int lanes;
};
Kind kind(Peak peak) {
  switch (peak) {
    case Peak::avx2_f32: return {"avx2_f32", chains_avx2_f32, 8};
    case Peak::avx2_f64: return {"avx2_f64", chains_avx2_f64, 4};
    case Peak::avx512_f32: return {"avx512_f32", chains_avx512_f32, 16};
    default: return {"avx512_f64", chains_avx512_f64, 8};
  }
}

}  // namespace

const char* to_string(Peak peak) { return kind(peak).name; }

bool supported(Peak peak) {
  if (peak == Peak::avx2_f32 || peak == Peak::avx2_f64)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return __builtin_cpu_supports("avx512f");
}

double run_peak(Peak peak, long rounds) {
  const Kind k = kind(peak);
  k.run(rounds);
  return 2.0 * chains * unrolled * k.lanes * static_cast<double>(rounds);
}

double measured_peak(Peak peak, double seconds) {
  if (!supported(peak)) return 0.0;
  run_peak(peak, 10000);  // the core may have to wake its wide units
  const double start = cpu_seconds();
  double flops = 0.0, spent = 0.0;
  while ((spent = cpu_seconds() - start) < seconds) flops += run_peak(peak, 10000);
  return 1e-9 * flops / spent;
}

Stream::Stream(long floats) : floats_(floats), a_(new float[floats]), b_(new float[floats]), c_(new float[floats]) {
  std::fill_n(a_, floats, 0.0f);
  std::fill_n(b_, floats, 1.0f);
  std::fill_n(c_, floats, 2.0f);
}

Stream::~Stream() {
  delete[] a_;
  delete[] b_;
  delete[] c_;
}

double Stream::pass() {
  for (long i = 0; i < floats_; ++i) a_[i] = b_[i] + 0.5f * c_[i];
  sink = a_[floats_ / 2];
  return 3.0 * sizeof(float) * static_cast<double>(floats_);
}

}  // namespace lockstep::bench
