// There is no empty Plan: compile() is the only way to one. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#ifdef MISTAKE
lockstep::Plan plan;
#else
lockstep::Plan plan = lockstep::compile({});
#endif
