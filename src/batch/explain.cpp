// A fault in words. SPDX-License-Identifier: Apache-2.0
#include <charconv>

#include "impl.h"

namespace lockstep {
namespace {

template <class Number>
std::string text_of(Number number) {
  char text[32];
  return std::string(text, std::to_chars(text, text + sizeof text, number).ptr);
}

const char* finder_of(FaultStage stage) {
  switch (stage) {
    case FaultStage::values: return "the look at values before the step";
    case FaultStage::matrix: return "the factorisation";
    case FaultStage::guard: return "the guard";
    case FaultStage::energy: return "the audit of energy";
    default: return "the look at the new state";
  }
}

}  // namespace

template <class S>
std::string Batch<S>::explain_fault(int environment) const {
  const Impl& batch = impl();
  batch.check_id(environment);
  const Fault fault = batch.rows.fault.data()[environment];
  if (fault == Fault::none) return "";
  const Program& program = program_of(batch.plan);
  const auto number = [&](const AlignedBlock<S>& block, std::ptrdiff_t row) {
    return block.data()[row * batch.stride + environment];
  };

  // What is wrong with the values that stand there now.
  std::string wrong;
  for (const Problem& problem : batch.bad_values(environment))
    wrong += (wrong.empty() ? "" : ", ") + problem.element + " (" + problem.field + ", row " + text_of(problem.row) +
             ") is " + text_of(static_cast<S>(problem.value)) + ", " + problem.rule;

  // What happened.
  std::string words = "environment " + text_of(environment) + ": " + to_string(fault) + ": ";
  switch (fault) {
    case Fault::bad_value: words += "a value cannot be"; break;
    case Fault::bad_input: words += "an action was NaN"; break;
    case Fault::not_finite: words += "a position or velocity became NaN or infinite"; break;
    case Fault::singular: words += "the mass matrix was not positive definite"; break;
    case Fault::too_fast: {
      words += "the motion is too fast for the step, so it would gain energy from nowhere";
      break;
    }
    default: {
      words += "a position would pass " + text_of(program.settings.position_bound) +
               (batch.tables.turning.count > 0 ? ", a joint without a range " + text_of(simd::most_turns<S>) + " turns,"
                                               : "") +
               " or a velocity " + text_of(program.settings.velocity_bound) +
               (batch.tables.spatial.used() ? ", or a tendon's length would leap or go on out of its range" : "");
    }
  }
  if (!wrong.empty()) words += "; " + wrong;

  // When, by which look, and to which joint.
  const FaultReport report = fault_report(environment);
  words += "; found in step " + text_of(report.step) + " since the reset, at " + text_of(report.time) + " s, by " +
           finder_of(report.stage);
  if (report.dof >= 0 && wrong.empty())
    words += "; " +
             std::string(fault == Fault::too_fast    ? "the fastest joint"
                         : fault == Fault::bad_input ? "the joint that it commands"
                                                     : "the joint to blame") +
             " is '" + program.dof_names[static_cast<std::size_t>(report.dof)] + "', now at " +
             text_of(number(batch.rows.position, report.dof)) + " with velocity " +
             text_of(number(batch.rows.velocity, report.dof));

  return words + "; " +
         (!wrong.empty()              ? "correct what is named"
          : fault == Fault::bad_input ? "correct the agent"
          : fault == Fault::too_fast  ? "use a smaller dt, leapfrog or more damping, or StepSettings::guard"
                                      : "look at inputs, parameters and dt") +
         ", and reset the environment";
}

template std::string Batch<float>::explain_fault(int) const;
template std::string Batch<double>::explain_fault(int) const;

}  // namespace lockstep
