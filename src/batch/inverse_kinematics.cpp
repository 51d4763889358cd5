// Batch::inverse_kinematics(): damped least squares in independent coordinates (M145). SPDX-License-Identifier:
// Apache-2.0
#include <fmt/format.h>

#include <Eigen/QR>

#include "impl.h"
#include "model/rotations.h"

namespace lockstep {
namespace {

constexpr double first_damping = 1e-3, least_damping = 1e-9, most_damping = 1e9;
/// A joint this near to an end of its range is there, rad or m: that may lie between two numbers of the batch.
template <class S>
double near_end(double end) {
  return std::max(1e-9, 4.0 * static_cast<double>(std::numeric_limits<S>::epsilon()) * std::abs(end));
}

// The search in one environment.
struct Search {
  bool searches = true;
  double damping = first_damping;
  Eigen::VectorXd error;     // m, rad: target less site
  Eigen::VectorXd position;  // where the joints were when it was measured
};

// min |J x - e|^2 + damping |x|^2 with A x = 0.
Eigen::VectorXd damped_step(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& error, const Eigen::MatrixXd& held,
                            double damping) {
  Eigen::MatrixXd free = Eigen::MatrixXd::Identity(jacobian.cols(), jacobian.cols());
  if (held.rows() > 0) {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factored(held.transpose());
    const Eigen::MatrixXd basis = factored.householderQ();
    free = basis.rightCols(basis.cols() - factored.rank()).eval();
  }
  if (free.cols() == 0) return Eigen::VectorXd::Zero(jacobian.cols());
  const Eigen::MatrixXd reduced = jacobian * free;
  Eigen::MatrixXd normal = reduced.transpose() * reduced;
  normal.diagonal().array() += damping;
  return free * normal.ldlt().solve(reduced.transpose() * error);
}

}  // namespace

template <class S>
auto Batch<S>::inverse_kinematics(int site, const Eigen::Ref<const Array>& targets, const EnvironmentSet& which,
                                  const InverseKinematicsOptions& options) -> Array {
  // Everything is looked at before anything is written.
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  const Plan& plan = batch.plan;
  const Site& frame = batch.site(site);
  const int link = plan.link(frame.link);
  const bool of_poses = targets.rows() == 7;
  if ((targets.rows() != 3 && !of_poses) || targets.cols() != batch.environments)
    throw UsageError("targets", fmt::format("are {} x {}", targets.rows(), targets.cols()),
                     fmt::format("give 3 or 7 rows x {} environments", batch.environments));
  if (options.iterations < 1 || !(options.tolerance > 0.0 && std::isfinite(options.tolerance)))
    throw UsageError("options of inverse kinematics",
                     fmt::format("are {} iterations and a tolerance of {}", options.iterations, options.tolerance),
                     "give 1 or more, and a finite tolerance above 0");
  std::vector<int> ids;
  which.for_each(batch.environments, [&](int e) { ids.push_back(e); });
  for (const int e : ids)
    if (!targets.col(e).isFinite().all() || (of_poses && !(targets.col(e).tail(4).matrix().norm() > S(1e-3))))
      throw UsageError(fmt::format("target of environment {}", e), "is not finite, or its quaternion is 0",
                       "give x, y, z and, for a pose, a quaternion w, x, y, z");
  std::vector<int> free;
  std::ranges::set_intersection(coordinate_dofs(plan), plan.independent_dofs(), std::back_inserter(free));
  const auto columns = static_cast<Eigen::Index>(free.size());
  const int dofs = plan.dofs(), first_column = 6 * static_cast<int>(plan.root_names().size());

  // Ranges of the environments.
  const Fields& model = fields_of(program_of(plan));
  const auto end_of_range = [&](int dof, int end, int e) {
    const int row = 2 * dof + end;
    const S* const own = batch.rows.field(Parameter::position_limits).data();
    return own ? static_cast<double>(own[row * batch.stride + e]) : model.value(Parameter::position_limits, row);
  };
  const auto clamped = [&](int dof, double number, int e) {
    return std::min(std::max(number, end_of_range(dof, 0, e)), end_of_range(dof, 1, e));
  };

  // Balls turn, and their ranges are of the angle.
  const Tables<double>& tables = program_of(plan).f64;
  std::vector<char> is_of_ball(static_cast<std::size_t>(dofs), 0);
  for (const BallJoint& ball : std::span(tables.balls.data, static_cast<std::size_t>(tables.balls.count)))
    for (int k = 0; k < 3; ++k) is_of_ball[static_cast<std::size_t>(tables.dof[ball.joint + k])] = 1;
  const auto within = [&](Eigen::VectorXd position, const Eigen::VectorXd& way, int e) {
    for (const int dof : free) {
      if (is_of_ball[static_cast<std::size_t>(dof)]) continue;
      position[dof] = clamped(dof, position[dof] + way[dof], e);
    }
    for (const BallJoint& ball : std::span(tables.balls.data, static_cast<std::size_t>(tables.balls.count))) {
      const int dof = tables.dof[ball.joint];
      Eigen::Vector3d turn = position.segment<3>(dof);
      turn = rotation_vector(turned_by(turn) * turned_by(way.segment<3>(dof)));
      const double most = end_of_range(dof, 1, e);
      position.segment<3>(dof) = turn * std::min(1.0, most / std::max(turn.norm(), 1e-300));
    }
    return position;
  };
  const auto position = [&](int e) -> Eigen::VectorXd {
    return batch.view(batch.rows.position).col(e).matrix().template cast<double>();
  };

  // How all dofs move with the coordinates: velocities that are placed in memory of their own.
  Array velocity = Array::Zero(dofs, batch.stride), root_velocity = Array::Zero(first_column, batch.stride);
  std::vector<UnmetCoupling> unmet;
  const auto place = [&](int e) {
    StatePointers<S> rows = batch.state_pointers();
    rows.velocity = velocity.data(), rows.root_velocity = root_velocity.data();
    const simd::StepMode mode;
    batch.placer.project(e, Couplings::all, rows, unmet);
    unmet.clear();  // what is left tells
  };
  const auto motion = [&](int e) {
    Eigen::MatrixXd all(dofs, columns);
    for (Eigen::Index k = 0; k < columns; ++k) {
      velocity.col(e).setZero(), root_velocity.col(e).setZero();
      velocity(free[static_cast<std::size_t>(k)], e) = S(1);
      place(e);
      all.col(k) = velocity.col(e).matrix().template cast<double>();
    }
    return all;
  };
  const auto put = [&](int e, const Eigen::VectorXd& numbers) {
    for (int dof = 0; dof < dofs; ++dof) batch.view(batch.rows.position)(dof, e) = static_cast<S>(numbers[dof]);
    velocity.col(e).setZero(), root_velocity.col(e).setZero();
    place(e);
  };

  // What is left to the targets.
  const Query pose{Quantity::site_pose, {site}};
  Array at(7, batch.environments);
  const auto read_sites = [&] {
    batch.read(std::span(&pose, 1), {at.data(), at.outerStride(), 1}, batch.environments);
  };
  const auto turn_of = [](const auto& rows, int e) {
    const auto number = [&](int k) { return static_cast<double>(rows(k, e)); };
    return Eigen::Quaterniond(number(3), number(4), number(5), number(6)).normalized();
  };
  const auto error_of = [&](int e) {
    Eigen::VectorXd error(of_poses ? 6 : 3);
    for (int k = 0; k < 3; ++k) error[k] = static_cast<double>(targets(k, e)) - static_cast<double>(at(k, e));
    if (of_poses) error.tail<3>() = rotation_vector(turn_of(targets, e) * turn_of(at, e).conjugate());
    return error;
  };
  const auto is_met = [&](const Eigen::VectorXd& error) {
    return error.head<3>().norm() <= options.tolerance && error.tail(error.size() - 3).norm() <= options.tolerance;
  };

  // From where the joints are, within their ranges.
  std::vector<Search> searches(ids.size());
  for (const int e : ids) {
    put(e, within(position(e), Eigen::VectorXd::Zero(dofs), e));
  }
  read_sites();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    searches[i].error = error_of(ids[i]), searches[i].position = position(ids[i]);
    searches[i].searches = searches[i].error.allFinite() && !is_met(searches[i].error);
  }

  // A step that leaves less is kept, and the next one is damped less; another one is taken back.
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    if (std::none_of(searches.begin(), searches.end(), [](const Search& search) { return search.searches; })) break;
    const Array jacobians = batch.read_frame_held(kernels::Quantity::frame_jacobian, link, frame.pose.translation(),
                                                  6 * batch.tables.velocities);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      Search& search = searches[i];
      const int e = ids[i];
      if (!search.searches) continue;
      const Eigen::MatrixXd moves = motion(e);
      Eigen::MatrixXd jacobian(search.error.size(), columns);
      for (int k = 0; k < search.error.size(); ++k) {  // linear, then angular
        Eigen::VectorXd row(dofs);
        for (int dof = 0; dof < dofs; ++dof)
          row[dof] = static_cast<double>(jacobians(6 * (first_column + dof) + (k < 3 ? k + 3 : k - 3), e));
        jacobian.row(k) = row.transpose() * moves;
      }

      // Joints at an end of their range stay there unless the step leads away from it.
      Eigen::MatrixXd held(0, columns);
      std::vector<char> is_held(static_cast<std::size_t>(dofs), 0);
      Eigen::VectorXd step, way;
      for (bool found = true; found;) {
        found = false;
        step = damped_step(jacobian, search.error, held, search.damping), way = moves * step;
        for (int dof = 0; dof < dofs; ++dof) {
          if (is_of_ball[static_cast<std::size_t>(dof)]) continue;
          const double q = search.position[dof], end = end_of_range(dof, way[dof] < 0.0 ? 0 : 1, e);
          const bool outwards =
              (way[dof] < 0.0 && q <= end + near_end<S>(end)) || (way[dof] > 0.0 && q >= end - near_end<S>(end));
          if (!outwards || is_held[static_cast<std::size_t>(dof)]) continue;
          is_held[static_cast<std::size_t>(dof)] = 1, found = true;
          held.conservativeResize(held.rows() + 1, columns);
          held.bottomRows(1) = moves.row(dof);
        }
      }

      // As far as the first end of a range.
      double share = 1.0;
      for (int dof = 0; dof < dofs; ++dof) {
        if (is_held[static_cast<std::size_t>(dof)] || way[dof] == 0.0 || is_of_ball[static_cast<std::size_t>(dof)])
          continue;
        const double room = (way[dof] > 0.0 ? end_of_range(dof, 1, e) : end_of_range(dof, 0, e)) - search.position[dof];
        share = std::min(share, std::max(0.0, room / way[dof]));
      }
      put(e, within(search.position, share * way, e));
    }

    read_sites();
    for (std::size_t i = 0; i < ids.size(); ++i) {
      Search& search = searches[i];
      if (!search.searches) continue;
      const Eigen::VectorXd now = position(ids[i]), error = error_of(ids[i]);
      bool kept = error.norm() < search.error.norm();
      for (int dof = 0; dof < dofs && kept; ++dof)  // followers of functions and in loops may pass an end
        for (const int end : {0, 1}) {
          if (is_of_ball[static_cast<std::size_t>(dof)]) break;
          const double sign = end == 1 ? 1.0 : -1.0, limit = end_of_range(dof, end, ids[i]);
          kept =
              kept && sign * (now[dof] - limit) <= std::max(near_end<S>(limit), sign * (search.position[dof] - limit)) +
                                                       rounding<S> * std::abs(limit);
        }
      if (kept)
        search.error = error, search.position = now, search.damping = std::max(least_damping, 0.2 * search.damping);
      else
        put(ids[i], search.position), search.damping *= 5.0;
      search.searches = !is_met(search.error) && search.damping <= most_damping;
    }
  }

  // Velocities of followers where the joints now are, and what is left.
  for (const int e : ids) batch.project(e, Couplings::all, unmet);
  Array left = Array::Zero(2, batch.environments);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Eigen::VectorXd& error = searches[i].error;
    left(0, ids[i]) = static_cast<S>(error.head<3>().norm());
    left(1, ids[i]) = static_cast<S>(error.tail(error.size() - 3).norm());
  }
  return left;
}

template auto Batch<float>::inverse_kinematics(int, const Eigen::Ref<const Array>&, const EnvironmentSet&,
                                               const InverseKinematicsOptions&) -> Array;
template auto Batch<double>::inverse_kinematics(int, const Eigen::Ref<const Array>&, const EnvironmentSet&,
                                                const InverseKinematicsOptions&) -> Array;

}  // namespace lockstep
