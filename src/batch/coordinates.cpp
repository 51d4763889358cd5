// SPDX-License-Identifier: Apache-2.0
#include "coordinates.h"

#include <fmt/format.h>

#include "lockstep/error.h"
#include "model/softness_numbers.h"
#include "spatial_tendons.h"

namespace lockstep {

std::vector<int> open_coordinate_dofs(const Plan& plan) {
  const Program& program = program_of(plan);
  std::vector<char> placed(static_cast<std::size_t>(plan.dofs()), 0);
  const auto place = [&](int joint) { placed[static_cast<std::size_t>(program.f64.dof[joint])] = 1; };
  for (const Placing::Turn& turn : program.placing_hard.turns) place(program.f64.term_joint[turn.term]);
  for (const int joint : program.placing_hard.ring_followers) place(joint);
  const SpatialTendonStructure& spatial = program.f64.spatial;
  for (int i = 0; i < spatial.tendons.count; ++i) place(spatial.tendons[i].joint);
  std::vector<int> dofs;
  for (int dof = 0; dof < plan.dofs(); ++dof)
    if (!placed[static_cast<std::size_t>(dof)]) dofs.push_back(dof);
  return dofs;
}

std::vector<int> coordinate_dofs(const Plan& plan) {
  int rows = 0;
  for (const PlanLoop& loop : plan.loops()) rows += loop.rows - loop.redundant;
  if (rows > static_cast<int>(plan.loop_dependent_dofs().size()))
    throw UsageError("plan", "has loops that hold floating roots, so roots are no coordinates of their own",
                     "bolt the roots, or leave these loops out");
  std::vector<int> dofs;
  std::ranges::set_difference(open_coordinate_dofs(plan), plan.loop_dependent_dofs(), std::back_inserter(dofs));
  return dofs;
}

template <class S>
void check_couplings_hold(const Plan& plan, const StatePointers<S>& rows, std::span<const int> ids) {
  const S* const on = rows.field(Parameter::coupling_switch);
  const S* const softness = rows.field(Parameter::softness);
  if (!on && !softness) return;
  const std::vector<std::string> names = coupling_names(plan.model());
  for (int c = 0; c < plan.couplings(); ++c) {
    const SoftnessKind kind = kind_of(plan.model().couplings[static_cast<std::size_t>(c)].softness);
    if (kind == SoftnessKind::spring || kind == SoftnessKind::frequency) continue;
    const std::string coupling = "has the coupling '" + names[static_cast<std::size_t>(c)] + "' ";
    for (const int e : ids) {
      if (on && on[c * rows.stride + e] == S(0))
        throw UsageError(fmt::format("environment {}", e),
                         coupling + "off, so its follower is no function of the coordinates",
                         "switch it on, or compile a model without it");
      if (softness && softness[(2 * c + 1) * rows.stride + e] != S(0))
        throw UsageError(fmt::format("environment {}", e),
                         coupling + "soft, so its follower is no function of the coordinates",
                         "make its cfm 0, or compile a model in which it is a Spring");
    }
  }
}

template <class S>
Coordinates<S>::Coordinates(const Plan& plan)
    : program_(program_of(plan)),
      first_dof_(6 * static_cast<int>(plan.root_names().size())),
      free_(open_coordinate_dofs(plan)),
      trees_(program_.model),
      columns_(Eigen::MatrixXd::Zero(first_dof_ + plan.dofs(), first_dof_ + static_cast<int>(free_.size()) + 1)) {
  columns_.topLeftCorner(first_dof_, first_dof_).setIdentity();
  for (std::size_t k = 0; k < free_.size(); ++k)
    columns_(first_dof_ + free_[k], first_dof_ + static_cast<int>(k)) = 1.0;
  const Placing& placing = program_.placing_hard;
  of_ring_.resize(static_cast<Eigen::Index>(placing.ring.size()),
                  static_cast<Eigen::Index>(placing.ring_followers.size()));
  right_.resize(of_ring_.rows(), columns_.cols());
}

template <class S>
void Coordinates<S>::find(const StatePointers<S>& rows, int e) {
  const Tables<double>& t = program_.f64;
  const Environment<S> at{t, rows, e, true, program_.model}, rates{t, rows, e, false, program_.model};
  // f'' v^2 of a coupling, (M139).
  const auto bend = [&](int c) {
    const int function = t.functions.used() ? t.functions.of_coupling[c] : -1;
    if (function < 0) return 0.0;
    const FunctionPlace& place = t.functions.places[function];
    const double speed = rates.number(place.leader);
    return at.curve(place, at.leader_of(place)).bend * speed * speed;
  };

  // One follower after the other.
  for (const Placing::Turn& turn : program_.placing_hard.turns) {
    auto follower = columns_.row(velocity_of(t.term_joint[turn.term]));
    follower.setZero();
    follower[count()] = bend(turn.coupling);
    for (int k = t.term_start[turn.coupling]; k < t.term_start[turn.coupling + 1]; ++k)
      if (k != turn.term) follower -= at.ratio(k) * columns_.row(velocity_of(t.term_joint[k]));
    follower /= at.ratio(turn.term);
  }

  // Those of a ring together.
  const std::vector<int>& ring = program_.placing_hard.ring;
  const std::vector<int>& followers = program_.placing_hard.ring_followers;
  if (ring.empty()) return find_spatial_tendons(rows, e);
  of_ring_.setZero(), right_.setZero();
  for (Eigen::Index r = 0; r < of_ring_.rows(); ++r) {
    const int c = ring[static_cast<std::size_t>(r)];
    right_(r, count()) = bend(c);
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
      const auto found = std::find(followers.begin(), followers.end(), t.term_joint[k]);
      if (found == followers.end())
        right_.row(r) -= at.ratio(k) * columns_.row(velocity_of(t.term_joint[k]));
      else
        of_ring_(r, found - followers.begin()) += at.ratio(k);
    }
  }
  const Eigen::MatrixXd solved = of_ring_.colPivHouseholderQr().solve(right_);
  for (std::size_t f = 0; f < followers.size(); ++f)
    columns_.row(velocity_of(followers[f])) = solved.row(static_cast<Eigen::Index>(f));
  find_spatial_tendons(rows, e);
}

// From the rows of all other joints. They have no inertia, so nothing needs their dS/dt z.
template <class S>
void Coordinates<S>::find_spatial_tendons(const StatePointers<S>& rows, int e) {
  each_spatial_tendon(
      program_, trees_, rows, e, [&](int tendon, double, const Eigen::RowVectorXd& jacobian, const LoopState& state) {
        auto row = columns_.row(velocity_of(tendon));
        row.setZero();
        each_loop_joint(program_, [&](std::size_t, Eigen::Index column, int joint) {
          row += jacobian[column] * columns_.row(velocity_of(joint));
        });
        each_loop_root(program_, trees_, [&](int tree, Eigen::Index column, int root) {
          for (int half = 0; half < 2; ++half)
            row.segment(6 * root + 3 * half, 3) +=
                jacobian.segment<3>(column + 3 * half) * state.at.root[static_cast<std::size_t>(tree)].linear();
        });
      });
}

template void check_couplings_hold(const Plan&, const StatePointers<float>&, std::span<const int>);
template void check_couplings_hold(const Plan&, const StatePointers<double>&, std::span<const int>);
template class Coordinates<float>;
template class Coordinates<double>;

}  // namespace lockstep
