// The exactly constrained continuous motion, by Runge-Kutta 4. SPDX-License-Identifier: Apache-2.0
#include "truth.h"

#include "couplings.h"
#include "functions.h"
#include "lockstep/error.h"
#include "loop_step.h"
#include "loops.h"
#include "nearest.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// An orthonormal basis of the generalised velocities that the hard couplings allow.
MatrixXd allowed_velocities(const Mechanism& mechanism, const Couplings& couplings) {
  std::vector<int> hard;
  for (int i = 0; i < couplings.count(); ++i)
    if (is_hard(couplings.softness[i]) && !couplings.redundant[i]) hard.push_back(i);
  const int nv = mechanism.velocities();
  if (hard.empty()) return MatrixXd::Identity(nv, nv);
  const MatrixXd rows = couplings.velocity_jacobian()(hard, Eigen::all);
  const MatrixXd q = rows.transpose().colPivHouseholderQr().householderQ();
  return q.rightCols(nv - rows.rows());
}

// A mechanism at positions q.
struct Constrained {
  Constrained(const Mechanism& m, const VectorXd& q)
      : mechanism(m),
        couplings(m, {}, q),
        jacobian(couplings.velocity_jacobian()),
        allowed(allowed_velocities(m, couplings)) {
    for (int i = 0; i < couplings.count(); ++i) {
      if (is_hard(couplings.softness[i])) continue;
      if (std::holds_alternative<ErpCfm>(couplings.softness[i]))
        throw SettingsError("softness", "is given by erp and cfm, which make no spring without a step",
                            "give kp and kd or a frequency");
    }
    if (has_yielding_loops(m.model()))
      throw SettingsError("softness", "is of a loop that yields or has a limit", "make loops hard, without limits");
  }

  MatrixXd mass(const State& state) const {
    MatrixXd mass = mechanism.mass_matrix(state);
    mass.diagonal() += mechanism.armature();
    return mass;
  }

  VectorXd soft_forces(const State& state, const MatrixXd& mass) const {
    VectorXd forces = VectorXd::Zero(mechanism.velocities());
    const VectorXd error = couplings.error(state.q), rate = jacobian * state.v;
    const VectorXd r = inverse_inertias(couplings, mass);
    for (int i = 0; i < couplings.count(); ++i) {
      if (is_hard(couplings.softness[i])) continue;
      const SpringConstants s = spring(couplings.softness[i], r[i], 0.0);
      forces -= jacobian.row(i).transpose() * (s.kp * error[i] + s.kd * rate[i]);
    }
    return forces;
  }

  // N^T (M dv/dt + c - forces) = 0 and dv/dt = N y + w: the couplings' forces do no work on the velocities that they
  // allow. w is what functions of joints ask for.
  VectorXd acceleration(const State& state, const Inputs& inputs) const {
    const MatrixXd m = mass(state);
    const VectorXd forces = mechanism.joint_forces(state, inputs) + mechanism.wrench_forces(state, inputs.wrenches) +
                            soft_forces(state, m) - mechanism.bias(state);
    const VectorXd w = curved_acceleration(mechanism, state);
    if (has_loops()) {
      const LoopRows loops = loop_rows(mechanism, state);
      return w + held(m, forces - m * w, loops.jacobian, -loops.bias - loops.jacobian * w);
    }
    return w + allowed * (allowed.transpose() * m * allowed).llt().solve(allowed.transpose() * (forces - m * w));
  }

  bool has_loops() const { return !mechanism.model().loops.empty(); }

  // The least 1/2 x^T M x - p^T x that the couplings allow and that gives the loops' rows these rates.
  VectorXd held(const MatrixXd& m, const VectorXd& p, const MatrixXd& loops, const VectorXd& rates) const {
    return allowed * nearest(allowed.transpose() * m * allowed, allowed.transpose() * p, {{loops * allowed, rates}}).v;
  }

  // The velocities that impulses of couplings and loops leave.
  VectorXd fitting(const State& state) const {
    const MatrixXd m = mass(state), loops = loop_rows(mechanism, state).jacobian;
    return held(m, m * state.v, loops, VectorXd::Zero(loops.rows()));
  }

  const Mechanism& mechanism;
  Couplings couplings;
  MatrixXd jacobian, allowed;
};

// State and its time derivative as one vector: position and quaternion x y z w of each root, q, v.
VectorXd packed(const State& state) {
  const Eigen::Index poses = 7 * static_cast<Eigen::Index>(state.roots.size());
  VectorXd y(poses + state.q.size() + state.v.size());
  for (std::size_t tree = 0; tree < state.roots.size(); ++tree)
    y.segment<7>(7 * static_cast<Eigen::Index>(tree)) << state.roots[tree].position,
        state.roots[tree].orientation.coeffs();
  y.tail(state.q.size() + state.v.size()) << state.q, state.v;
  return y;
}

State unpacked(const VectorXd& y, const State& like) {
  State state = like;
  Eigen::Index at = 0;
  for (RootPose& root : state.roots) {
    root.position = y.segment<3>(at);
    root.orientation.coeffs() = y.segment<4>(at + 3);
    at += 7;
  }
  state.q = y.segment(at, like.q.size());
  state.v = y.tail(like.v.size());
  return state;
}

VectorXd derivative(const Mechanism& mechanism, const State& state, const Inputs& inputs) {
  State rate = state;
  for (std::size_t tree = 0; tree < state.roots.size(); ++tree) {
    RootPose& root = rate.roots[tree];
    root.position.setZero();
    root.orientation.coeffs().setZero();
    const int first = mechanism.root_velocity(static_cast<int>(tree));
    if (first < 0) continue;
    // dp/dt = R v and dQ/dt = 1/2 Q w with w in root axes. Only the direction of Q counts, so it need not be unit.
    const Eigen::Quaterniond &turn = state.roots[tree].orientation,
                             w(0.0, state.v[first], state.v[first + 1], state.v[first + 2]);
    root.position = turn.normalized() * Eigen::Vector3d(state.v.segment<3>(first + 3));
    root.orientation.coeffs() = 0.5 * (turn * w).coeffs();
  }
  rate.q = mechanism.rates(state.q, state.v);
  rate.v = Constrained(mechanism, state.q).acceleration(state, inputs);
  return packed(rate);
}

}  // namespace

VectorXd acceleration(const Mechanism& mechanism, const State& state, const Inputs& inputs) {
  return Constrained(mechanism, state.q).acceleration(state, inputs);
}

Motion integrate(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs, double interval,
                 int intervals, int steps) {
  const Constrained system(mechanism, start.q);
  State state = start;
  const VectorXd error = system.couplings.error(state.q);
  for (int i = 0; i < system.couplings.count(); ++i)
    if (is_hard(system.couplings.softness[i]) && std::abs(error[i]) > 1e-9)
      throw SettingsError("start", "violates a hard coupling", "start where C = 0");
  const VectorXd gaps = loop_rows(mechanism, state).error;
  if (gaps.size() > 0 && gaps.cwiseAbs().maxCoeff() > 1e-9)
    throw SettingsError("start", "has an open loop", "start where C = 0");
  const std::vector<bool> is_curved = curved(mechanism.model());
  if (!mechanism.model().loops.empty() && std::find(is_curved.begin(), is_curved.end(), true) != is_curved.end())
    throw SettingsError("truth", "does not close loops beside functions of joints", "leave out one of them");
  state.v = system.fitting(state);

  Motion motion;
  motion.times = VectorXd::LinSpaced(intervals + 1, 0.0, interval * intervals);
  motion.positions.resize(intervals + 1, mechanism.dofs());
  motion.positions.row(0) = state.q;
  Inputs acting = mechanism.initial_inputs();
  const auto slope = [&](double t, const VectorXd& y) {
    inputs(t, acting);
    return derivative(mechanism, unpacked(y, start), acting);
  };
  const double h = interval / steps;
  for (int i = 0; i < intervals; ++i) {
    for (int k = 0; k < steps; ++k) {
      const double t = (i * steps + k) * h;
      const VectorXd y = packed(state);
      const VectorXd k1 = slope(t, y);
      const VectorXd k2 = slope(t + h / 2, y + h / 2 * k1);
      const VectorXd k3 = slope(t + h / 2, y + h / 2 * k2);
      const VectorXd k4 = slope(t + h, y + h * k3);
      state = unpacked(y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), start);
      for (RootPose& root : state.roots) root.orientation.normalize();
      if (system.has_loops()) {
        state = closed(mechanism, state);
        state.v = system.fitting(state);
      }
    }
    motion.positions.row(i + 1) = state.q;
  }
  motion.end = state;
  return motion;
}

Motion integrate_with_error(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs,
                            double interval, int intervals, int steps) {
  const Motion coarse = integrate(mechanism, start, inputs, interval, intervals, steps);
  Motion fine = integrate(mechanism, start, inputs, interval, intervals, 2 * steps);
  // Half the step has a sixteenth of the error, as the order is 4.
  fine.error = (fine.positions - coarse.positions).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() / 15.0;
  return fine;
}

}  // namespace lockstep::reference
