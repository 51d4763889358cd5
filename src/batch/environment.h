// The state and the couplings of one environment, as numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "model/functions.h"
#include "plan/program.h"
#include "targets/kernel_set.h"
#include "turned.h"

namespace lockstep {

/// The error of a coupling, and the size of its terms.
struct CouplingError {
  double value = 0.0, size = 0.0;
  void add(const CouplingError& other) { value += other.value, size += other.size; }
  /// What is left of velocities that are 0 is, too.
  bool is_rounding(double share) const { return std::abs(value) <= share * size + 1e-20; }
};

/// Positions or velocities of environment e, and the numbers that it has of its own.
template <class S>
struct Environment {
  const Tables<double>& t;
  const StatePointers<S>& rows;
  int e;
  bool of_positions;
  const Model& model;

  double parameter(Parameter field, int row, double model) const {
    const S* const values = rows.field(field);
    return values ? static_cast<double>(values[row * rows.stride + e]) : static_cast<double>(static_cast<S>(model));
  }
  JointTurns<S> turns(int joint) const {
    const std::ptrdiff_t at = t.dof[joint] * rows.stride + e;
    return of_positions ? turned(t, joint, rows.position[at], rows.angle, at) : JointTurns<S>{rows.velocity[at], S(0)};
  }
  double number(int joint) const {
    const JointTurns<S> joint_turns = turns(joint);
    return 2.0 * std::numbers::pi * static_cast<double>(joint_turns.turns) + static_cast<double>(joint_turns.angle);
  }
  // Of a coupling. As in the kernels, ratios are rounded to S but where they multiply turns (M81).
  CouplingError term(int k) const {
    const JointTurns<S> joint = turns(t.term_joint[k]);
    const bool own = t.term_gear[k] >= 0 && rows.field(Parameter::gear_ratio);
    const double by_angle = ratio(k) * static_cast<double>(joint.angle);
    const double by_turns = (own ? ratio(k) : t.term_value[k]) * static_cast<double>(joint.turns);
    return {by_angle + 2.0 * std::numbers::pi * by_turns, std::abs(by_angle)};
  }
  void put(int joint, double number) const {
    const std::ptrdiff_t at = t.dof[joint] * rows.stride + e;
    if (of_positions)
      turn_to(t, joint, number, rows.position[at], rows.angle, at);
    else
      rows.velocity[at] = static_cast<S>(number);
  }
  // A function is as good as its tangent where its leader stands: the tangent's slope and offset.
  simd::Curve<double> curve(const FunctionPlace& place, double x) const {
    Function own = *model.couplings[static_cast<std::size_t>(place.coupling)].function;
    if (rows.field(Parameter::function)) {
      std::vector<double> numbers;
      for (int i = place.first; i < place.first + place.count; ++i)
        numbers.push_back(parameter(Parameter::function, i, t.functions.number[i]));
      set_numbers(own, numbers);
    }
    return curve_at(own, x);
  }
  double leader_of(const FunctionPlace& place) const {
    return Environment{t, rows, e, true, model}.number(place.leader);
  }
  double ratio(int term) const {
    for (int i = 0; i < t.functions.places.count; ++i)
      if (const FunctionPlace& place = t.functions.places[i]; place.term == term)
        return -curve(place, leader_of(place)).slope;
    return t.term_gear[term] < 0 ? 1.0 : parameter(Parameter::gear_ratio, t.term_gear[term], t.term_value[term]);
  }
  double offset(int c) const {
    if (!of_positions) return 0.0;
    if (t.functions.used() && t.functions.of_coupling[c] >= 0) {
      const FunctionPlace& place = t.functions.places[t.functions.of_coupling[c]];
      const double x = leader_of(place);
      const simd::Curve<double> at = curve(place, x);
      return at.slope * x - at.value;
    }
    return parameter(Parameter::offset, c, t.offset[c]);
  }
};

}  // namespace lockstep
