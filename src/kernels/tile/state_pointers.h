// StatePointers: the rows of a batch, as plain pointers for kernels. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "lockstep/enums.h"

namespace lockstep {

/// What found the fault of an environment, and in which dof, -1 if in none.
struct FaultPlace {
  FaultStage stage = FaultStage::none;
  std::int32_t dof = -1;
};

/// Rows [dof][environment], `stride` numbers apart. Environments are padded to whole tiles.
template <class S>
struct StatePointers {
  std::ptrdiff_t stride = 0;
  S* position = nullptr;
  S* velocity = nullptr;
  S* angle = nullptr;          ///< rows of positions without whole turns, null if no joint turns for ever
  S* root_pose = nullptr;      ///< 7 rows for each floating root, null if there is none
  S* root_velocity = nullptr;  ///< 6 rows for each, the same
  const S* position_target = nullptr;
  const S* velocity_target = nullptr;
  const S* effort = nullptr;
  const S* fields[parameter_count] = {};  ///< by Parameter, null if not declared or without rows
  S* impulse = nullptr;                   ///< rows by coupling, null unless recorded
  S* residual = nullptr;                  ///< by reported row, null unless diagnostics are recorded
  S* row_state = nullptr;                 ///< the same
  S* energy = nullptr;                    ///< 4 rows, the same
  S* audit = nullptr;                     ///< 2 rows, null unless audited: energy from nowhere, largest kinetic energy
  S* contact_memory = nullptr;            ///< ContactTables::remembered() rows, null without contacts
  Fault* fault = nullptr;
  FaultPlace* place = nullptr;
  std::uint32_t* steps = nullptr;  ///< good ones since the last reset, as they were when step() was called

  inline __attribute__((always_inline)) const S* field(Parameter parameter) const {
    return fields[static_cast<unsigned>(parameter)];
  }
};

}  // namespace lockstep
