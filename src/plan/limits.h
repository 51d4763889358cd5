// How large a step may be. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "program.h"

namespace lockstep {

/// Of one matrix of a step. A mechanism that needs more is refused before its matrix is laid out.
inline constexpr long most_entries = 1L << 21;

inline constexpr const char* the_elimination = "the elimination of its followers";
inline constexpr const char* the_response_matrix = "the matrix K of its rows";
inline constexpr const char* the_mass_matrix = "the mass matrix of its joints";

/// Throws ModelError if a matrix of a step, in words, would have more entries than that.
void require_room(const Program& program, long entries, const char* matrix);

/// Entries of a symmetric matrix of n rows, which is stored once.
inline long pair_count(std::size_t n) { return static_cast<long>(n * (n + 1) / 2); }

/// How many entries a matrix has whose elimination tree has these parents.
long entries_of(const std::vector<int>& parent);

}  // namespace lockstep
