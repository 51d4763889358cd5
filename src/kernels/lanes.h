// What a kernel is handed: the state of a batch, by plain pointers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace lockstep {

enum class Fault : std::uint32_t;  // batch.h

constexpr int parameter_fields = 9;

/// Rows [dof][environment], `stride` numbers apart. Environments are padded to whole tiles.
template <class S>
struct Lanes {
  std::ptrdiff_t stride = 0;
  S* position = nullptr;
  S* velocity = nullptr;
  S* root_pose = nullptr;      ///< 7 rows, null if fixed
  S* root_velocity = nullptr;  ///< 6 rows, null if fixed
  const S* position_target = nullptr;
  const S* velocity_target = nullptr;
  const S* effort = nullptr;
  const S* field[parameter_fields] = {};  ///< by Parameter, null if not declared or without rows
  S* impulse = nullptr;        ///< rows by coupling, null unless recorded
  S* residual = nullptr;       ///< rows by name, null unless diagnostics are recorded
  S* row_state = nullptr;      ///< the same
  S* energy = nullptr;         ///< 4 rows, the same
  Fault* fault = nullptr;
};

}  // namespace lockstep
