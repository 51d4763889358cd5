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

void add(std::string& list, const std::string& what) { list += (list.empty() ? "" : ", ") + what; }

}  // namespace

template <class S>
std::string Batch<S>::explain_fault(int environment) const {
  const Impl& batch = impl();
  batch.check_id(environment);
  const Fault fault = batch.fault.data()[environment];
  if (fault == Fault::none) return "";
  const Program& program = program_of(batch.plan);
  const auto number = [&](const AlignedBlock<S>& block, std::ptrdiff_t row) {
    return block.data()[row * batch.stride + environment];
  };

  // What is wrong with the values that stand there now.
  std::string wrong;
  for (const ValueRule<S>& rule : batch.rules.rows)
    if (const S value = number(batch.field[static_cast<int>(rule.field)], rule.row); !rule.holds(value))
      add(wrong, rule.element + " (" + to_string(rule.field) + ", row " + text_of(rule.row) + ") is " + text_of(value) +
                     ", must be " + rule.range);
  for (const BodyLinks& body : batch.rules.bodies)
    if (!(batch.mass_of(body, environment) > S(0))) add(wrong, "masses of link " + body.element + " sum up to 0");
  for (const LimitPair& pair : batch.rules.pairs) {
    const AlignedBlock<S>& limits = batch.field[static_cast<int>(Parameter::position_limits)];
    if (!(number(limits, pair.row) <= number(limits, pair.row + 1)))
      add(wrong, pair.element + " (position_limits, rows " + text_of(pair.row) + ", " + text_of(pair.row + 1) +
                     ") are " + text_of(number(limits, pair.row)) + " and " + text_of(number(limits, pair.row + 1)) +
                     ", must be in ascending order");
  }
  for (const InertiaRule<S>& rule : batch.rules.inertias)
    if (!batch.is_possible(rule, environment))
      add(wrong, "no body can have the inertia of link " + rule.element +
                     ": a moment is negative, or larger than the sum of the two others");
  for (std::size_t root = 0; root < program.root_names.size(); ++root)
    if (!batch.has_turn(environment, static_cast<int>(root)))
      add(wrong, "the quaternion of root '" + program.root_names[root] + "' is 0");
  const auto find_infinite = [&](const AlignedBlock<S>& block, const std::string& what, bool by_dof) {
    const std::ptrdiff_t rows = static_cast<std::ptrdiff_t>(block.size()) / batch.stride;
    for (std::ptrdiff_t row = 0; row < rows; ++row) {
      if (std::isfinite(number(block, row))) continue;
      const std::string where =
          by_dof ? " of joint '" + program.dof_names[row % batch.tables.joints] + "'" : " row " + text_of(row);
      add(wrong, what + where + " is " + text_of(number(block, row)));
    }
  };
  find_infinite(batch.position, "position", true);
  find_infinite(batch.velocity, "velocity", true);
  find_infinite(batch.root_pose, "root pose", false);
  find_infinite(batch.root_velocity, "root velocity", false);
  find_infinite(batch.position_target, "position target", true);
  find_infinite(batch.velocity_target, "velocity target", true);
  find_infinite(batch.effort, "effort", true);
  for (const Parameter field : {Parameter::offset, Parameter::gravity, Parameter::link_wrench,
                                Parameter::coupling_switch})  // the others have rules
    find_infinite(batch.field[static_cast<int>(field)], to_string(field), false);

  std::string words = "environment " + text_of(environment) + ": " + to_string(fault) + ": ";
  switch (fault) {
    case Fault::bad_value: words += "a value cannot be"; break;
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
               " or a velocity " + text_of(program.settings.velocity_bound);
    }
  }
  if (!wrong.empty()) words += "; " + wrong;
  const FaultReport report = fault_report(environment);
  words += "; found in step " + text_of(report.step) + " since the reset, at " + text_of(report.time) + " s, by " +
           finder_of(report.stage);
  if (report.dof >= 0 && wrong.empty())
    words += "; " + std::string(fault == Fault::too_fast ? "the fastest joint" : "the joint to blame") + " is '" +
             program.dof_names[static_cast<std::size_t>(report.dof)] + "', now at " +
             text_of(number(batch.position, report.dof)) + " with velocity " +
             text_of(number(batch.velocity, report.dof));
  return words + "; " +
         (!wrong.empty()             ? "correct what is named"
          : fault == Fault::too_fast ? "use a smaller dt, leapfrog or more damping, or StepSettings::guard"
                                     : "look at inputs, parameters and dt") +
         ", and reset the environment";
}

template std::string Batch<float>::explain_fault(int) const;
template std::string Batch<double>::explain_fault(int) const;

}  // namespace lockstep
