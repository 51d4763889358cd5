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
#include "model/softness_numbers.h"
#include "plan/program.h"
#include "plan/relations.h"
#include "spatial_tendons.h"

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
    place_spatial(e, rows);
    for (int c = 0; c < program_.f64.couplings; ++c) {
      if (!takes({program_.f64, rows, e, true, program_.model}, c, all)) continue;
      const CouplingError position = error_of({program_.f64, rows, e, true, program_.model}, c),
                          velocity = error_of({program_.f64, rows, e, false, program_.model}, c);
      if (!position.is_rounding(rounding<S>) || !velocity.is_rounding(rounding<S>))
        unmet.push_back({e, c, position.value, velocity.value});
    }
  }

 private:
  static CouplingError error_of(const Environment<S>& at, int c) {
    CouplingError error;
    error.add({at.offset(c), std::abs(at.offset(c))});
    for (int k = at.t.term_start[c]; k < at.t.term_start[c + 1]; ++k) error.add(at.term(k));
    return error;
  }

  void place(int e, const Placing& placing, bool all, const StatePointers<S>& rows) {
    for (const bool of_positions : {true, false}) {
      const Environment<S> at{program_.f64, rows, e, of_positions, program_.model};
      for (const Placing::Turn& turn : placing.turns)
        if (takes(at, turn.coupling, all)) place(at, turn);
      // The second time takes away what the first one lost beside followers that stood far off.
      for (int time = 0; time < 2 && !placing.ring.empty() && solve(at, placing, all); ++time) {
      }
    }
  }

  void place_spatial(int e, const StatePointers<S>& rows) const {
    const auto put = [&](bool of_positions, int joint, double number) {
      Environment<S>{program_.f64, rows, e, of_positions, program_.model}.put(joint, number);
    };
    each_spatial_tendon(program_, closer_.trees(), rows, e,
                        [&](int joint, double length, const Eigen::RowVectorXd& jacobian, const LoopState& state) {
                          put(true, joint, length), put(false, joint, jacobian.dot(state.velocity));
                        });
  }

  // Returns whether something has moved.
  bool close_loops(int e, bool all, const StatePointers<S>& rows, std::vector<UnmetCoupling>& unmet) const {
    const Environment<S> positions{program_.f64, rows, e, true, program_.model};
    const LoopState before = loop_state(program_, closer_.trees(), rows, e);
    LoopState state = before;
    std::vector<double> frames;
    if (const S* const own = rows.field(Parameter::loop_frame))
      for (std::size_t row = 0; row < 7 * program_.model.loops.size(); ++row)
        frames.push_back(static_cast<double>(own[static_cast<std::ptrdiff_t>(row) * rows.stride + e]));
    closer_.close(
        e, rounding<S>, frames, [&](int l) { return positions.parameter(Parameter::loop_switch, l, 1.0) != 0.0; },
        relations_of(
            program_, [&](int c) { return takes(positions, c, all); }, [&](int, int k) { return positions.ratio(k); },
            [&](int c) { return positions.offset(c); }),
        state, unmet);
    return put_loop_state(program_, closer_.trees(), before, state, rows, e);
  }

  bool takes(const Environment<S>& at, int c, bool soft_too) const {
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
  static void place(const Environment<S>& at, const Placing::Turn& turn) {
    if (error_of(at, turn.coupling).is_rounding(least_rounding)) return;
    double others = at.offset(turn.coupling);
    for (int k = at.t.term_start[turn.coupling]; k < at.t.term_start[turn.coupling + 1]; ++k)
      if (k != turn.term) others += at.term(k).value;
    at.put(at.t.term_joint[turn.term], -others / at.ratio(turn.term));
  }

  // Gauss-Jordan elimination of the ring's couplings over the changes of its followers. Followers without a pivot, as
  // couplings may be switched off, stay. Returns false where there was nothing to change.
  bool solve(const Environment<S>& at, const Placing& placing, bool all) {
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
      const CouplingError error = error_of(at, c);
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
