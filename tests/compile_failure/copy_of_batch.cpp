// A Batch can be moved but not copied. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <utility>

lockstep::Batch<float> move_out(lockstep::Batch<float>& batch) {
#ifdef MISTAKE
  return batch;
#else
  return std::move(batch);
#endif
}
