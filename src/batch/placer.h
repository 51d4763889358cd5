// Places followers by their couplings, in the state of one environment. SPDX-License-Identifier: Apache-2.0
//
// Most couplings place one follower after the other (plan/couplings/followers.cpp). Those of a ring wait for each
// other: they are solved together, by Gauss-Jordan elimination. In double, whatever the state's precision is.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "loop_closer.h"
#include "model/functions.h"
#include "model/softness_numbers.h"
#include "plan/program.h"
#include "plan/relations.h"
#include "turned.h"

namespace lockstep {

/// An error up to this share of a coupling's terms is rounding.
template <class S>
constexpr double rounding = sizeof(S) == 4 ? 1e-5 : 1e-8;

inline void check_couplings(Couplings couplings) {
  if (couplings < Couplings::none || couplings > Couplings::all)
    throw UsageError("couplings", "are none of the enumerators", "give none, hard or all");
}

template <class S>
class Placer {
 public:
  explicit Placer(const Program& program) : program_(program), closer_(program.model) {
    for (const Placing* placing : {&program.placing_all, &program.placing_hard}) {
      pivot_.resize(std::max(pivot_.size(), placing->ring.size()));
      ring_.resize(std::max(ring_.size(), placing->ring.size() * (placing->ring_followers.size() + 1)));
    }
  }

  /// In environment e.
  void project(int e, Couplings couplings, const StatePointers<S>& rows, std::vector<UnmetCoupling>& unmet) {
    if (couplings == Couplings::none) return;
    const bool all = couplings == Couplings::all;
    const Placing& placing = all ? program_.placing_all : program_.placing_hard;
    place(e, placing, all, rows);
    // Functions are tangents in the closing, so it is repeated.
    for (int time = 0; closer_.used() && time < (program_.f64.functions.used() ? most_tangents : 1); ++time) {
      const std::size_t before = unmet.size();
      const bool moved = close_loops(e, all, rows, unmet);
      if (moved) place(e, placing, all, rows);  // also tendons of the joints that have moved
      if (!moved || time + 1 == most_tangents) break;
      if (program_.f64.functions.used()) unmet.resize(before);
    }
    for (int c = 0; c < program_.f64.couplings; ++c) {
      if (!takes({program_.f64, rows, e, true, program_.model}, c, all)) continue;
      const Error position = error_of({program_.f64, rows, e, true, program_.model}, c),
                  velocity = error_of({program_.f64, rows, e, false, program_.model}, c);
      if (!position.is_rounding(rounding<S>) || !velocity.is_rounding(rounding<S>))
        unmet.push_back({e, c, position.value, velocity.value});
    }
  }

 private:
  struct Error {
    double value = 0.0, size = 0.0;
    void add(const Error& other) { value += other.value, size += other.size; }
    bool is_rounding(double share) const { return std::abs(value) <= share * size; }
  };

  // Positions or velocities of one environment.
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
      return of_positions ? turned(t, joint, rows.position[at], rows.angle, at)
                          : JointTurns<S>{rows.velocity[at], S(0)};
    }
    double number(int joint) const {
      const JointTurns<S> joint_turns = turns(joint);
      return 2.0 * std::numbers::pi * static_cast<double>(joint_turns.turns) + static_cast<double>(joint_turns.angle);
    }
    // Of a coupling. As in the kernels, ratios are rounded to S but where they multiply turns (M81).
    Error term(int k) const {
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

  static Error error_of(const Environment& at, int c) {
    Error error;
    error.add({at.offset(c), std::abs(at.offset(c))});
    for (int k = at.t.term_start[c]; k < at.t.term_start[c + 1]; ++k) error.add(at.term(k));
    return error;
  }

  void place(int e, const Placing& placing, bool all, const StatePointers<S>& rows) {
    for (const bool of_positions : {true, false}) {
      const Environment at{program_.f64, rows, e, of_positions, program_.model};
      for (const Placing::Turn& turn : placing.turns)
        if (takes(at, turn.coupling, all)) place(at, turn);
      // The second time takes away what the first one lost beside followers that stood far off.
      for (int time = 0; time < 2 && !placing.ring.empty() && solve(at, placing, all); ++time) {
      }
    }
  }

  // Returns whether something has moved.
  bool close_loops(int e, bool all, const StatePointers<S>& rows, std::vector<UnmetCoupling>& unmet) const {
    const Model& model = program_.model;
    const Environment positions{program_.f64, rows, e, true, program_.model},
        velocities{program_.f64, rows, e, false, program_.model};
    const auto joints = static_cast<Eigen::Index>(model.joints.size());
    const auto each_joint = [&](const auto& act) {
      for (std::size_t j = 0; j < model.joints.size(); ++j)
        if (program_.solver_joint[j] >= 0 && model.joints[j].kind != JointKind::tendon)
          act(j, static_cast<Eigen::Index>(j), program_.solver_joint[j]);
    };
    const auto each_root = [&](const auto& act) {
      int row = 0;
      for (int tree = 0; tree < closer_.trees().count(); ++tree)
        if (closer_.trees().roots[tree].floating) act(tree, joints + 6 * tree, row++);
    };

    // The state.
    LoopState state{start_of(model, closer_.trees()), Eigen::VectorXd::Zero(joints + 6 * closer_.trees().count())};
    each_joint([&](std::size_t j, Eigen::Index column, int joint) {
      state.at.position[j] = positions.number(joint);
      state.velocity[column] = velocities.number(joint);
    });
    const auto pose_row = [&](int row, int k) -> S& { return rows.root_pose[(7 * row + k) * rows.stride + e]; };
    const auto twist_row = [&](int row, int k) -> S& { return rows.root_velocity[(6 * row + k) * rows.stride + e]; };
    each_root([&](int tree, Eigen::Index column, int row) {
      Eigen::Isometry3d& pose = state.at.root[tree];
      for (int k = 0; k < 3; ++k) pose.translation()[k] = static_cast<double>(pose_row(row, k));
      const auto number = [&](int k) { return static_cast<double>(pose_row(row, k)); };
      pose.linear() = Eigen::Quaterniond(number(3), number(4), number(5), number(6)).normalized().toRotationMatrix();
      for (int k = 0; k < 6; ++k) state.velocity[column + k] = static_cast<double>(twist_row(row, k));
      state.velocity.segment<3>(column) = pose.linear() * state.velocity.segment<3>(column);
      state.velocity.segment<3>(column + 3) = pose.linear() * state.velocity.segment<3>(column + 3);
    });
    const LoopState before = state;

    // Closed.
    std::vector<double> frames;
    if (const S* const own = rows.field(Parameter::loop_frame))
      for (std::size_t row = 0; row < 7 * model.loops.size(); ++row)
        frames.push_back(static_cast<double>(own[static_cast<std::ptrdiff_t>(row) * rows.stride + e]));
    closer_.close(
        e, rounding<S>, frames.empty() ? nullptr : frames.data(),
        [&](int l) { return positions.parameter(Parameter::loop_switch, l, 1.0) != 0.0; },
        relations_of(
            program_, [&](int c) { return takes(positions, c, all); }, [&](int, int k) { return positions.ratio(k); },
            [&](int c) { return positions.offset(c); }),
        state, unmet);

    // What has moved is written back.
    bool moved = false;
    each_joint([&](std::size_t j, Eigen::Index column, int joint) {
      if (state.at.position[j] != before.at.position[j]) positions.put(joint, state.at.position[j]), moved = true;
      if (state.velocity[column] != before.velocity[column]) velocities.put(joint, state.velocity[column]);
    });
    each_root([&](int tree, Eigen::Index column, int row) {
      const Eigen::Isometry3d& pose = state.at.root[tree];
      if (!pose.isApprox(before.at.root[tree], 0.0)) {
        moved = true;
        const Eigen::Quaterniond turn(pose.linear());
        const double numbers[] = {pose.translation().x(),
                                  pose.translation().y(),
                                  pose.translation().z(),
                                  turn.w(),
                                  turn.x(),
                                  turn.y(),
                                  turn.z()};
        for (int k = 0; k < 7; ++k) pose_row(row, k) = static_cast<S>(numbers[k]);
      }
      if (state.velocity.segment<6>(column) == before.velocity.segment<6>(column)) return;
      for (int half = 0; half < 2; ++half) {
        const Eigen::Vector3d own = pose.linear().transpose() * state.velocity.segment<3>(column + 3 * half);
        for (int k = 0; k < 3; ++k) twist_row(row, 3 * half + k) = static_cast<S>(own[k]);
      }
    });
    return moved;
  }

  bool takes(const Environment& at, int c, bool soft_too) const {
    if (at.parameter(Parameter::coupling_switch, c, 1.0) == 0.0) return false;
    const Softness& softness = program_.model.couplings[c].softness;
    const SoftnessNumbers model = numbers_of(softness);
    const double first = at.parameter(Parameter::softness, 2 * c, model.first),
                 second = at.parameter(Parameter::softness, 2 * c + 1, model.second);
    switch (kind_of(softness)) {
      case SoftnessKind::hard:
      case SoftnessKind::erp_cfm: return soft_too || second == 0.0;
      case SoftnessKind::spring: return soft_too && (first != 0.0 || second != 0.0);
      case SoftnessKind::frequency: return soft_too && first != 0.0;
    }
    return false;
  }

  // A coupling that holds to rounding stays as it is.
  static void place(const Environment& at, const Placing::Turn& turn) {
    if (error_of(at, turn.coupling).is_rounding(least_rounding)) return;
    double others = at.offset(turn.coupling);
    for (int k = at.t.term_start[turn.coupling]; k < at.t.term_start[turn.coupling + 1]; ++k)
      if (k != turn.term) others += at.term(k).value;
    at.put(at.t.term_joint[turn.term], -others / at.ratio(turn.term));
  }

  // Gauss-Jordan elimination of the ring's couplings over the changes of its followers. Followers without a pivot, as
  // couplings may be switched off, stay. Returns false where there was nothing to change.
  bool solve(const Environment& at, const Placing& placing, bool all) {
    const std::size_t rows = placing.ring.size(), columns = placing.ring_followers.size();
    const auto entry = [&](std::size_t r, std::size_t c) -> double& { return ring_[r * (columns + 1) + c]; };

    // J of the ring over its followers, beside minus the errors.
    std::fill(ring_.begin(), ring_.end(), 0.0);
    bool holds = true;
    for (const int joint : placing.ring_followers)
      if (!std::isfinite(at.number(joint))) at.put(joint, 0.0);
    for (std::size_t r = 0; r < rows; ++r) {
      const int c = placing.ring[r];
      if (!takes({at.t, at.rows, at.e, true, at.model}, c, all)) continue;
      const Error error = error_of(at, c);
      holds = holds && error.is_rounding(least_rounding);
      entry(r, columns) = -error.value;
      for (int k = at.t.term_start[c]; k < at.t.term_start[c + 1]; ++k)
        for (std::size_t f = 0; f < columns; ++f)
          if (placing.ring_followers[f] == at.t.term_joint[k]) entry(r, f) = at.ratio(k);
    }
    if (holds) return false;

    // Elimination, with the largest entry of each row as pivot.
    for (std::size_t r = 0; r < rows; ++r) {
      std::size_t pivot = 0;
      for (std::size_t f = 1; f < columns; ++f)
        if (std::abs(entry(r, f)) > std::abs(entry(r, pivot))) pivot = f;
      const bool found = std::abs(entry(r, pivot)) > least_pivot;
      pivot_[r] = found ? pivot : columns;
      for (std::size_t other = 0; found && other < rows; ++other) {
        const double factor = entry(other, pivot) / entry(r, pivot);
        if (other == r || factor == 0.0) continue;
        for (std::size_t c = 0; c <= columns; ++c) entry(other, c) -= factor * entry(r, c);
        entry(other, pivot) = 0.0;
      }
    }

    // The followers' changes.
    for (std::size_t r = 0; r < rows; ++r) {
      if (pivot_[r] == columns) continue;
      const int joint = placing.ring_followers[pivot_[r]];
      at.put(joint, at.number(joint) + entry(r, columns) / entry(r, pivot_[r]));
    }
    return true;
  }

  static constexpr int most_tangents = 30;
  static constexpr double least_rounding = 4.0 * std::numeric_limits<S>::epsilon(), least_pivot = 1e-9;

  const Program& program_;
  LoopCloser closer_;
  std::vector<double> ring_;  // [couplings][followers and the right-hand side]
  std::vector<std::size_t> pivot_;
};

}  // namespace lockstep
