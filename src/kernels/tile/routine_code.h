// The machine code of a plan's routines, as a tile knows it. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep::jit {
struct Frame;
}

namespace lockstep::kernels {

enum class Routine : int {
  kinematics,   ///< of euler: sines and cosines of the joints
  forces,       ///< bias forces, forces of the joints, and the matrix
  momenta,      ///< what the forces add in the step
  free_step,    ///< the step without bounds and contacts
  midpoint,     ///< of leapfrog: the way to it
  prediction,   ///< its first stage, with the matrix of the step
  bias,         ///< forces at the predicted velocities
  stages,       ///< without bounds, where they do not act in all lanes
  end,          ///< the way there from the midpoint
  begin_round,  ///< of Newton's method: its terms and gradient
  solve_round,  ///< its factor and its step
  count
};
constexpr int routine_count = static_cast<int>(Routine::count);
constexpr const char* routine_names[routine_count] = {"kinematics", "forces",      "momenta",    "free step",
                                                      "midpoint",   "prediction",  "bias",       "stages",
                                                      "end",        "begin round", "solve round"};

using RoutineCode = void (*)(const jit::Frame* first, const jit::Frame* last);

/// Of one tile.
struct Routines {
  const RoutineCode* code = nullptr;  ///< [routine_count], null where the tables run
  const void* tables = nullptr;       ///< of the step that it was made for; halves have others, and no code
  const void* solve = nullptr;        ///< and of its rounds
  const jit::Frame* frame = nullptr;  ///< of the tile; `behind` ends the range
  const jit::Frame* behind = nullptr;

  RoutineCode code_of(const void* t, Routine which) const {
    return code && t == (which < Routine::begin_round ? tables : solve) ? code[static_cast<int>(which)] : nullptr;
  }
};

}  // namespace lockstep::kernels
