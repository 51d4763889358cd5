// Counts what a program allocates, by operator new and by malloc. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

// A sanitizer puts its own malloc where the counting one would be: then only operator new counts.
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__)
#define LOCKSTEP_COUNTS_MALLOC 1
#endif

namespace lockstep::contract {

/// By this program so far, in all threads.
std::size_t allocations();

}  // namespace lockstep::contract
