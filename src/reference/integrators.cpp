// Leapfrog, its extrapolation and Runge-Kutta 4, with dense matrices. SPDX-License-Identifier: Apache-2.0
#include "integrators.h"

#include "followers.h"
#include "functions.h"
#include "lockstep/error.h"
#include "loop_step.h"
#include "loops.h"
#include "nearest.h"

namespace lockstep::reference {
namespace {
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// (M69)
constexpr double gamma = 0.43586652150845899942;
constexpr double b1 = -((6.0 * gamma - 16.0) * gamma + 1.0) / 4.0, b2 = ((6.0 * gamma - 20.0) * gamma + 5.0) / 4.0;
constexpr double stages[3][3] = {{gamma, 0.0, 0.0}, {(1.0 - gamma) / 2.0, gamma, 0.0}, {b1, b2, gamma}};
constexpr double shares[3] = {gamma, (1.0 + gamma) / 2.0, 1.0};

struct Task {
  const Mechanism& mechanism;
  const StepSettings& settings;
  std::function<Inputs(double share)> inputs;
  int chords;
};

// The inertia at one pose, with the armatures, the loops, and the couplings: hard ones as rows, soft ones as springs.
struct System {
  System(const Task& task, const State& state, const std::vector<bool>& off)
      : couplings(task.mechanism, off, state.q),
        mass(task.mechanism.mass_matrix(state)),
        all(couplings.velocity_jacobian()),
        loops(loop_rows(task.mechanism, state).jacobian) {
    mass.diagonal() += task.mechanism.armature();
    kp = kd = VectorXd::Zero(couplings.count());
    for (int i = 0; i < couplings.count(); ++i) {
      if (couplings.off[i] || couplings.redundant[i]) continue;
      if (is_hard(couplings.softness[i])) {
        hard.push_back(i);
      } else {
        const SpringConstants s = spring(couplings.softness[i], inverse_inertias(couplings, mass)[i], task.settings.dt);
        kp[i] = s.kp, kd[i] = s.kd;
      }
    }
    rows = all(hard, Eigen::all);
  }

  VectorXd soft_forces(const State& state) const {
    return -all.transpose() * (kp.cwiseProduct(couplings.error(state.q)) + kd.cwiseProduct(all * state.v));
  }

  // D of A D = right + J^T L and J D = rate, of the hard couplings, and then of the loops.
  VectorXd change(const MatrixXd& a, const VectorXd& right, const VectorXd& rate, const VectorXd& loop_rate) const {
    return nearest(a, right, {{rows, rate}, {loops, loop_rate}}).v;
  }

  Couplings couplings;
  MatrixXd mass, all, rows;  // J of all couplings and of the hard ones
  MatrixXd loops;            // J of the loops
  std::vector<int> hard;
  VectorXd kp, kd;  // by coupling; zero for hard ones
};

// dJ/dt v of the loops at the middle of a step, for a velocity along its axes that is constant in inertial ones.
VectorXd loop_bias(const Mechanism& mechanism, State middle, const VectorXd& velocity) {
  middle.v = velocity;
  const LoopRows rows = loop_rows(mechanism, middle);
  return rows.bias + mechanism.inertial_axes_bias(rows.jacobian, velocity) +
         rows.jacobian * curved_acceleration(mechanism, middle);
}

// Closes loops at the end of a step by steps of least norm in A, all with J of its middle. Couplings stay.
void close(const Task& task, const System& system, const MatrixXd& a, const State& middle, State& end) {
  const Mechanism& mechanism = task.mechanism;
  for (int chord = 0; chord < task.chords; ++chord) {
    const LoopRows rows = loop_rows(mechanism, end);
    VectorXd share(rows.error.size());
    for (Eigen::Index i = 0; i < share.size(); ++i) share[i] = erp_of(mechanism.model().loops[rows.loop[i]].softness);
    State moving = end;
    moving.v =
        system.change(a, VectorXd::Zero(a.rows()), VectorXd::Zero(system.rows.rows()), -share.cwiseProduct(rows.error));
    mechanism.turn_axes(middle, moving);
    end = mechanism.advanced(end, moving.v, 1.0);
  }
}

// (M66) to (M70) for a part of a step: `from` and `length` are shares of the step. `predicted` becomes c of (M67).
// Loops are in section 30.
State leapfrog(const Task& task, const State& start, double from, double length, VectorXd* predicted = nullptr) {
  const Mechanism& mechanism = task.mechanism;
  const double h = length * task.settings.dt, stage_h = gamma * h;
  State middle = mechanism.advanced(start, start.v, h / 2.0);
  mechanism.turn_axes(start, middle);
  middle = placed(mechanism, std::move(middle));
  const VectorXd v = middle.v;
  const Inputs held = task.inputs(from + length / 2.0);
  const System system(task, middle, held.off);
  const auto bias = [&](const VectorXd& velocity) -> VectorXd {
    State moving = middle;
    moving.v = velocity;
    return mechanism.bias(moving) - mechanism.wrench_forces(middle, held.wrenches) +
           mechanism.inertial_axes_bias(system.mass, velocity) + system.mass * curved_acceleration(mechanism, moving);
  };
  const VectorXd springs = stage_h * (system.kd + stage_h * system.kp);
  MatrixXd implicit = system.mass + system.all.transpose() * springs.asDiagonal() * system.all;
  implicit.diagonal() +=
      stage_h * (mechanism.damping() + mechanism.kd()) + stage_h * stage_h * (mechanism.kp() + mechanism.stiffness());
  // Delta_i, after which J V = rate. That of loops is 0 at the middle of the step, and changes with J.
  VectorXd turning = loop_bias(mechanism, middle, v);
  const auto stage = [&](int i, const VectorXd& c, const State& at, const VectorXd& rate) {
    State ahead = at;
    ahead.q += stage_h * at.v.tail(mechanism.dofs());
    const VectorXd drives = mechanism.joint_forces(ahead, task.inputs(from + length * shares[i]));
    return system.change(implicit, stage_h * (drives + system.soft_forces(ahead) - c), rate - system.rows * at.v,
                         (0.5 - shares[i]) * h * turning - system.loops * at.v);
  };
  const VectorXd zero = VectorXd::Zero(system.rows.rows());
  State at = middle;
  at.q = start.q;
  const VectorXd v_m = v + stage(0, bias(v), at, zero) / (2.0 * gamma), c = bias(v_m);  // (M67)
  turning = loop_bias(mechanism, middle, v_m);
  if (predicted) *predicted = c;
  MatrixXd velocities(v.size(), 3), changes(v.size(), 3);
  for (int i = 0; i < 3; ++i) {
    VectorXd way = VectorXd::Zero(mechanism.dofs());
    at.v = v;
    for (int k = 0; k < i; ++k) {
      way += h * stages[i][k] * velocities.col(k).tail(mechanism.dofs());
      at.v += stages[i][k] / gamma * changes.col(k);
    }
    at.q = mechanism.moved(start.q, way);
    changes.col(i) = stage(i, c, at, zero);
    velocities.col(i) = at.v + changes.col(i);
  }
  VectorXd correction = -system.couplings.error(at.q) / stage_h;
  const std::vector<bool> is_curved = curved(mechanism.model());
  for (const int i : system.hard) correction[i] *= is_curved[i] ? 0.0 : erp_of(system.couplings.softness[i]);
  const VectorXd corrected = at.v + stage(2, c, at, correction(system.hard));  // positions only
  const VectorXd mean = b1 * velocities.col(0) + b2 * velocities.col(1) + gamma * corrected;
  State end = mechanism.advanced(middle, 2.0 * mean - v, h / 2.0);
  end.v = velocities.col(2);
  mechanism.turn_axes(middle, end);
  close(task, system, implicit, middle, end);
  return placed(mechanism, std::move(end));
}

// a + share b for all numbers of the state, the seven of each root's pose included.
State sum(State a, double share, const State& b) {
  for (std::size_t tree = 0; tree < a.roots.size(); ++tree) {
    a.roots[tree].position += share * b.roots[tree].position;
    a.roots[tree].orientation.coeffs() += share * b.roots[tree].orientation.coeffs();
  }
  a.q += share * b.q;
  a.v += share * b.v;
  return a;
}

// (M71)
State extrapolated(const Task& task, const State& start) {
  const State halves = leapfrog(task, leapfrog(task, start, 0.0, 0.5), 0.5, 0.5);
  State end = sum(sum(halves, 1.0 / 3.0, halves), -1.0 / 3.0, leapfrog(task, start, 0.0, 1.0));
  for (RootPose& root : end.roots) root.orientation.normalize();
  return placed(task.mechanism, std::move(end));
}

// (M72) to (M74)
State runge_kutta(const Task& task, const State& start) {
  const Mechanism& mechanism = task.mechanism;
  const double h = task.settings.dt, times[] = {0.0, 0.5, 0.5, 1.0}, weights[] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
  State end = start, change = sum(start, -1.0, start);
  for (int i = 0; i < 4; ++i) {
    const State at = placed(mechanism, sum(start, times[i], change));
    const Inputs inputs = task.inputs(times[i]);
    const System system(task, at, inputs.off);
    const VectorXd forces = mechanism.joint_forces(at, inputs) + mechanism.wrench_forces(at, inputs.wrenches) +
                            system.soft_forces(at) - mechanism.bias(at) -
                            system.mass * curved_acceleration(mechanism, at);
    change.v = system.change(system.mass, h * forces, -system.rows * at.v, VectorXd());
    change.q = h * mechanism.rates(at.q, at.v);
    for (std::size_t tree = 0; tree < at.roots.size(); ++tree) {
      const int first = mechanism.root_velocity(static_cast<int>(tree));
      if (first < 0) continue;
      const Eigen::Quaterniond w(0.0, at.v[first], at.v[first + 1], at.v[first + 2]),
          &turn = at.roots[tree].orientation;
      change.roots[tree].position = h * (turn.normalized() * Vector3d(at.v.segment<3>(first + 3)));
      change.roots[tree].orientation.coeffs() = 0.5 * h * (turn * w).coeffs();
    }
    end = sum(end, weights[i], change);
  }
  for (RootPose& root : end.roots) root.orientation.normalize();
  const Stage stage(mechanism, h, start, task.inputs(0.0));  // has the followers' errors
  end.q += h * follower_corrections(mechanism, stage, task.settings).tail(mechanism.dofs());
  return placed(mechanism, std::move(end));
}

}  // namespace

VectorXd predicted_bias(const Mechanism& mechanism, const StepSettings& settings, const State& start,
                        const Inputs& inputs) {
  VectorXd bias;
  leapfrog({mechanism, settings, [&](double) { return inputs; }, 0}, start, 0.0, 1.0, &bias);
  return bias;
}

State integrated(const Mechanism& mechanism, const StepSettings& settings, const State& state, const InputsInStep& set,
                 int chords) {
  if (!mechanism.model().loops.empty() && settings.integrator != Integrator::leapfrog)
    throw SettingsError("integrator", "has no closed loops", "name leapfrog");
  if (has_yielding_loops(mechanism.model()))
    throw SettingsError("softness", "is of a loop that yields or has a limit", "make loops hard, without limits");
  const auto acting = [&](double share) {
    Inputs inputs = mechanism.initial_inputs();
    set(share, inputs);
    return inputs;
  };
  const Task task{mechanism, settings, acting, chords};
  switch (settings.integrator) {
    case Integrator::leapfrog: return leapfrog(task, state, 0.0, 1.0);
    case Integrator::extrapolated: return extrapolated(task, state);
    case Integrator::runge_kutta: return runge_kutta(task, state);
    default: throw SettingsError("integrator", "is of first order", "name leapfrog, extrapolated or runge_kutta");
  }
}

}  // namespace lockstep::reference
