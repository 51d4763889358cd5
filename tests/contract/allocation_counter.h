// Counts the allocations of a program by operator new and by malloc. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

// The address sanitizer replaces malloc itself: with it, only operator new counts.
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__)
#define LOCKSTEP_COUNTS_MALLOC 1
#endif

namespace lockstep::contract {

/// Number of allocations in all threads of this program so far.
std::size_t allocations();

/// Whether operator new fails for memory that is aligned to cache lines and more.
void refuse_aligned(bool refused);

}  // namespace lockstep::contract
