// Batch::check(): what is wrong with the values that stand there. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "impl.h"

namespace lockstep {

template <class S>
class Batch<S>::Impl::ProblemFinder {
 public:
  ProblemFinder(const Impl& batch, int environment, std::vector<Problem>& found)
      : batch_(batch), program_(program_of(batch.plan)), environment_(environment), found_(found) {}

  // Values that lead to a fault.
  void find_bad_values() {
    find_broken_rules();
    for (std::size_t root = 0; root < program_.root_names.size(); ++root)
      if (!batch_.has_turn(environment_, static_cast<int>(root)))
        add("root_poses", 7 * static_cast<int>(root) + 3, 0.0,
            "the quaternion of root '" + program_.root_names[root] + "'", "must not be 0");
    const auto joint = [&](int row) {
      return " of joint '" + program_.dof_names[static_cast<std::size_t>(row % batch_.tables.joints)] + "'";
    };
    find_infinite(batch_.rows.position, "positions", [&](int row) { return "position" + joint(row); });
    find_infinite(batch_.rows.velocity, "velocities", [&](int row) { return "velocity" + joint(row); });
    find_infinite(batch_.rows.root_pose, "root_poses", [&](int row) { return "pose" + root(row / 7); });
    find_infinite(batch_.rows.root_velocity, "root_velocities", [&](int row) { return "velocity" + root(row / 6); });
    find_infinite(batch_.rows.position_target, "position_targets",
                  [&](int row) { return "position target" + joint(row); });
    find_infinite(batch_.rows.velocity_target, "velocity_targets",
                  [&](int row) { return "velocity target" + joint(row); });
    find_infinite(batch_.rows.effort, "efforts", [&](int row) { return "effort" + joint(row); });
    for (const Parameter field : {Parameter::gravity, Parameter::link_wrench})  // the others have rules
      find_infinite(batch_.rows.field(field), to_string(field), [&](int row) {
        return to_string(field) + (" '" + batch_.plan.parameter_row_names(field)[static_cast<std::size_t>(row)] + "'");
      });
  }

  // Targets that nothing follows.
  void find_idle_targets() {
    for (std::size_t j = 0; j < program_.model.joints.size(); ++j) {
      const Joint& joint = program_.model.joints[j];
      const int dof = program_.dof_of_joint[j];
      if (dof < 0 || joint.drive.kinematic || gain(2 * dof) != 0.0 || gain(2 * dof + 1) != 0.0) continue;
      const auto look = [&](const AlignedBlock<S>& targets, const char* field, const char* what, double model) {
        for (int row = dof; row < batch_.tables.joints * batch_.tables.input_times; row += batch_.tables.joints)
          if (const S target = number(targets, row); std::isfinite(target) && target != static_cast<S>(model))
            add(field, row, target, what + (" of joint '" + joint.name + "'"), "has no effect: the joint has no drive");
      };
      look(batch_.rows.position_target, "position_targets", "position target", joint.drive.position_target);
      look(batch_.rows.velocity_target, "velocity_targets", "velocity target", joint.drive.velocity_target);
    }
  }

 private:
  void find_broken_rules() {
    for (const ValueRule<S>& rule : batch_.rules.rows)
      if (const S value = number(batch_.rows.field(rule.field), rule.row); !rule.holds(value))
        add(to_string(rule.field), rule.row, value, rule.element, "must be " + rule.range);
    for (const BodyLinks& body : batch_.rules.bodies)
      if (const S mass = batch_.mass_of(body, environment_); !(mass > S(0)))
        add("mass", body.links[0], mass, "the sum of the masses of link " + body.element, "must be above 0");
    const AlignedBlock<S>& limits = batch_.rows.field(Parameter::position_limits);
    for (const LimitPair& pair : batch_.rules.pairs)
      if (const S lower = number(limits, pair.row), upper = number(limits, pair.row + 1); !(lower <= upper))
        add("position_limits", pair.row, lower, "lower limit of " + pair.element,
            fmt::format("must be at most the upper limit, which is {}", upper));
    const AlignedBlock<S>& frames = batch_.rows.field(Parameter::loop_frame);
    for (const TurnRows& turn : batch_.rules.turns)
      if (!turn.hold([&](int row) { return number(frames, row); }))
        add("loop_frame", turn.row, number(frames, turn.row), "the quaternion of the " + turn.element,
            "must have a length of 0.001 to 1000");
    for (const InertiaRule<S>& rule : batch_.rules.inertias) {
      if (batch_.is_possible(rule, environment_)) continue;
      Parameter field = Parameter::inertia;
      int row = 6 * rule.parts[0].link;
      if (!batch_.tables.declares(field)) field = Parameter::center_of_mass, row = 3 * rule.parts[0].link;
      if (!batch_.tables.declares(field)) field = Parameter::mass, row = rule.parts[0].link;
      add(to_string(field), row, number(batch_.rows.field(field), row), "inertia of link " + rule.element,
          "must be one that a body can have: no moment is negative, or larger than the sum of the two others");
    }
  }

  template <class Name>
  void find_infinite(const AlignedBlock<S>& block, const char* field, const Name& name) {
    const int rows = static_cast<int>(static_cast<std::ptrdiff_t>(block.size()) / batch_.stride);
    for (int row = 0; row < rows; ++row)
      if (const S value = number(block, row); !std::isfinite(value))
        add(field, row, value, name(row), "must be finite");
  }

  std::string root(int index) const {
    return " of root '" + program_.root_names[static_cast<std::size_t>(index)] + "'";
  }

  double gain(int row) const {
    const AlignedBlock<S>& own = batch_.rows.field(Parameter::drive_gains);
    return own.size() > 0 ? static_cast<double>(number(own, row))
                          : fields_of(program_).value(Parameter::drive_gains, row);
  }

  S number(const AlignedBlock<S>& block, std::ptrdiff_t row) const {
    return block.data()[row * batch_.stride + environment_];
  }

  void add(const char* field, int row, S value, const std::string& element, const std::string& rule) {
    found_.push_back({environment_, field, row, static_cast<double>(value), element, rule});
  }

  const Impl& batch_;
  const Program& program_;
  int environment_;
  std::vector<Problem>& found_;
};

template <class S>
std::vector<Problem> Batch<S>::Impl::bad_values(int environment) const {
  std::vector<Problem> found;
  ProblemFinder(*this, environment, found).find_bad_values();
  return found;
}

template <class S>
std::vector<Problem> Batch<S>::check(const EnvironmentSet& which) const {
  const Impl& batch = impl();
  const Alone alone(impl().in_use);
  std::vector<Problem> found;
  which.for_each(batch.environments, [&](int e) {
    typename Impl::ProblemFinder finder(batch, e, found);
    finder.find_bad_values();
    finder.find_idle_targets();
  });
  return found;
}

template std::vector<Problem> Batch<float>::Impl::bad_values(int) const;
template std::vector<Problem> Batch<double>::Impl::bad_values(int) const;
template std::vector<Problem> Batch<float>::check(const EnvironmentSet&) const;
template std::vector<Problem> Batch<double>::check(const EnvironmentSet&) const;

}  // namespace lockstep
