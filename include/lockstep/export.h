// LOCKSTEP_API: what a shared library of lockstep shows. SPDX-License-Identifier: Apache-2.0
#pragma once

/// The library is compiled with hidden visibility; only what carries this macro can be linked to.
#define LOCKSTEP_API __attribute__((visibility("default")))
