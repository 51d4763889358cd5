// A Batch holds floats or doubles. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#ifdef MISTAKE
using Number = int;
#else
using Number = double;
#endif

void run(const lockstep::Plan& plan) { lockstep::Batch<Number> batch(plan, 4); }
