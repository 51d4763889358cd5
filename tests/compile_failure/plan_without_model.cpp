// There is no empty Plan: only compile() makes one. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#ifdef MISTAKE
lockstep::Plan plan;
#else
lockstep::Plan plan = lockstep::compile({});
#endif
