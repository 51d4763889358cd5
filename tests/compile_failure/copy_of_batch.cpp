// A Batch moves; a copy of so much memory would be a mistake. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <utility>

lockstep::Batch<float> taken(lockstep::Batch<float>& batch) {
#ifdef MISTAKE
  return batch;
#else
  return std::move(batch);
#endif
}
