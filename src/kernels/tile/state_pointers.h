// The rows of a batch, stated once: what each is called, how many there are, and what becomes of them.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "lockstep/enums.h"
#include "plan/tables.h"

namespace lockstep {

/// What found the fault of an environment, and in which dof, -1 if in none.
struct FaultPlace {
  FaultStage stage = FaultStage::none;
  std::int32_t dof = -1;
};

/// What becomes of rows when an environment is reset, saved and restored.
enum class RowKind {
  state,    ///< reset and saved
  input,    ///< the same, but a reset may keep them
  field,    ///< a parameter: saved, not reset
  memory,   ///< what the library keeps between steps: reset and saved; restored under other settings, it begins anew
  reading,  ///< of the last step, for those who ask: 0 after a reset and a restore, and not saved
  result,   ///< of the last step: neither reset nor saved
  label,    ///< who the environment is, and its episode: saved, not reset
};

/// Rows of one name.
struct BatchBlock {
  const char* name;  ///< null for a field
  RowKind kind;
  int rows;
  int traffic;         ///< numbers that step(1) reads and writes. Which inputs and fields it reads depends on the plan
  int parameter = -1;  ///< of a field
};

/// Rows [dof][environment], `stride` numbers apart, as Hold::Rows<E> keeps them. Environments are padded to whole
/// tiles.
template <class S, class Hold>
struct BatchRows {
  template <class E>
  using Rows = typename Hold::template Rows<E>;
  template <class E>
  using Inputs = typename Hold::template Inputs<E>;

  std::ptrdiff_t stride = 0;
  Rows<S> position{};
  Rows<S> velocity{};
  Rows<S> angle{};          ///< positions without whole turns, if a joint turns for ever
  Rows<S> root_pose{};      ///< 7 rows for each floating root
  Rows<S> root_velocity{};  ///< 6 rows for each
  Inputs<S> position_target{};
  Inputs<S> velocity_target{};
  Inputs<S> effort{};
  Inputs<S> fields[parameter_count] = {};  ///< by Parameter, if declared
  Rows<S> applied_input{};                 ///< by input and dof, what drives apply where some are late
  Rows<S> applied_limit{};                 ///< by dof, the effort limits of motors in this step, and the others
  Rows<S> waiting_input{};                 ///< see DelayedDrive
  Rows<S> lagged_input{};                  ///< by lagged drive and input
  Rows<S> lag{};                           ///< lag_rows by lagged drive
  Rows<S> impulse{};                       ///< by coupling, if recorded
  Rows<S> loop_force{};                    ///< 6 rows by loop, see Quantity::loop_force
  Rows<S> residual{};                      ///< by reported row, if diagnostics are recorded
  Rows<S> row_state{};                     ///< the same
  Rows<S> energy{};                        ///< 4 rows, the same
  Rows<S> audit{};                         ///< 2 rows if audited: energy from nowhere, largest kinetic energy
  Rows<S> drive_effort{};                  ///< drive_effort_rows by dof, if recorded: see kernels/records.h
  Rows<S> contact_history{};               ///< contact_history_rows by pair, the same
  Rows<S> acceleration{};                  ///< by dof, then 6 by floating root, the same
  Rows<S> contact_wrench{};                ///< 6 by contact: force, moment about the world's origin, the same
  Rows<S> contact_memory{};                ///< see ContactTables::remembered()
  Rows<S> solve_counts{};                  ///< see SolveCounts, of the last call of step()
  Rows<Fault> fault{};
  Rows<FaultPlace> place{};
  Rows<std::uint32_t> steps{};  ///< good ones since the last reset; in a step, as they were when it was called
  Rows<std::uint32_t> resets{};
  Rows<std::uint32_t> id{};
  Rows<std::uint64_t> seed{};

  inline __attribute__((always_inline)) const Inputs<S>& field(Parameter parameter) const {
    return fields[static_cast<unsigned>(parameter)];
  }
};

/// act(block, rows of each of `all`...) for every block that a batch may have; one that it has not has 0 rows.
template <class S, class Act, class... All>
inline __attribute__((always_inline)) void each_block(const Tables<S>& t, const Act& act, All&... all) {
  constexpr RowKind state = RowKind::state, label = RowKind::label, input = RowKind::input, memory = RowKind::memory,
                    reading = RowKind::reading, result = RowKind::result, field = RowKind::field;
  const int n = t.joints, inputs = n * t.input_times, roots = t.roots.count;
  const int angles = t.turning.count > 0 ? n : 0, impulses = t.record_impulses ? t.couplings : 0;
  const int reported = t.record_diagnostics ? t.reported.count : 0, energies = t.record_diagnostics ? 4 : 0;
  const int remembered = t.contacts.remembered(t), counts = t.counts_solves() ? solve_count_rows : 0;
  const int efforts = t.record_efforts ? drive_effort_rows * n : 0;
  const int history = t.record_contacts ? contact_history_rows * t.contacts.contacts.count : 0;
  const int accelerations = t.record_accelerations ? n + 6 * roots : 0;
  const int wrenches = t.record_accelerations ? 6 * t.contacts.contacts.count : 0;
  act(BatchBlock{"fault", state, 1, 1}, all.fault...);
  act(BatchBlock{"fault place", state, 1, 0}, all.place...);
  act(BatchBlock{"steps", state, 1, 2}, all.steps...);
  act(BatchBlock{"resets", label, 1, 0}, all.resets...);
  act(BatchBlock{"id", label, 1, 0}, all.id...);
  act(BatchBlock{"seed", label, 1, 0}, all.seed...);
  act(BatchBlock{"position", state, n, 2 * n}, all.position...);
  act(BatchBlock{"angle", state, angles, t.turning.count}, all.angle...);
  act(BatchBlock{"velocity", state, n, 2 * n}, all.velocity...);
  act(BatchBlock{"root pose", state, 7 * roots, 14 * roots}, all.root_pose...);
  act(BatchBlock{"root velocity", state, 6 * roots, 12 * roots}, all.root_velocity...);
  act(BatchBlock{"position target", input, inputs, 0}, all.position_target...);
  act(BatchBlock{"velocity target", input, inputs, 0}, all.velocity_target...);
  act(BatchBlock{"effort", input, inputs, 0}, all.effort...);
  const auto& late = t.actuators;
  const int applied = late.is_late() ? drive_inputs * n : 0, limits = late.motors.count > 0 ? n : 0;
  act(BatchBlock{"applied input", result, applied, 2 * applied}, all.applied_input...);
  act(BatchBlock{"applied limit", result, limits, limits}, all.applied_limit...);
  act(BatchBlock{"waiting input", memory, late.waiting, 2 * late.waiting}, all.waiting_input...);
  act(BatchBlock{"lagged input", memory, drive_inputs * late.lagged.count, 2 * drive_inputs * late.lagged.count},
      all.lagged_input...);
  act(BatchBlock{"lag", result, lag_rows * late.lagged.count, (lag_rows - 1) * late.lagged.count}, all.lag...);
  act(BatchBlock{"audit", memory, t.audited ? 2 : 0, t.audited ? 4 : 0}, all.audit...);
  act(BatchBlock{"contacts", memory, remembered, 2 * remembered}, all.contact_memory...);
  act(BatchBlock{"drive effort", memory, efforts, efforts}, all.drive_effort...);
  act(BatchBlock{"contact history", memory, history, 2 * history}, all.contact_history...);
  act(BatchBlock{"acceleration", memory, accelerations, accelerations}, all.acceleration...);
  act(BatchBlock{"wrenches of pairs", memory, wrenches, wrenches}, all.contact_wrench...);
  act(BatchBlock{"impulse", reading, impulses, impulses}, all.impulse...);
  act(BatchBlock{"loop force", memory, 6 * t.loops.loops.count, 6 * t.loops.loops.count}, all.loop_force...);
  act(BatchBlock{"residual", reading, reported, reported}, all.residual...);
  act(BatchBlock{"row state", reading, reported, reported}, all.row_state...);
  act(BatchBlock{"solve counts", reading, counts, counts}, all.solve_counts...);
  act(BatchBlock{"energy", reading, energies, energies}, all.energy...);
  // Motors have effort limits of their own, declared or not: see StatePointers.
  for (int f = 0; (t.per_environment != 0 || limits > 0) && f < parameter_count; ++f)
    act(BatchBlock{nullptr, field, t.declares(Parameter(f)) ? rows_of(t, Parameter(f)) : 0, 0, f}, all.fields[f]...);
}

struct PlainPointers {
  template <class E>
  using Rows = E*;
  template <class E>
  using Inputs = const E*;
};

/// What kernels know of a batch. Where actuators are late or limited, targets, efforts and effort limits are those that
/// drives apply, and these are what the batch shows.
template <class S>
struct StatePointers : BatchRows<S, PlainPointers> {
  const S* shown_input[drive_inputs] = {};
  const S* shown_limit = nullptr;
};

}  // namespace lockstep
