// The state of a const Batch is read-only. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#ifdef MISTAKE
void change(const lockstep::Batch<float>& batch) { batch.positions()(0, 0) = 1.0f; }
#else
void change(lockstep::Batch<float>& batch) { batch.positions()(0, 0) = 1.0f; }
#endif
