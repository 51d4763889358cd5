// The continuous motion with bounds, event by event. SPDX-License-Identifier: Apache-2.0
#include "events.h"

#include <cmath>

#include "convex.h"
#include "couplings.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double at_rest = 1e-9;  // speeds and rebounds below this are none

// Where a joint is between two events.
struct Place {
  int end = 0;        // -1 or 1 at an end of its range, at rest
  int fastest = 0;    // -1 or 1 at its velocity limit
  int direction = 0;  // -1 or 1 while it slips; 0 sticks
};

class Events {
 public:
  Events(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs)
      : mechanism_(mechanism), inputs_(inputs), acting_(mechanism.initial_inputs()), state_(start) {
    const Couplings couplings(mechanism);
    const MatrixXd j = couplings.velocity_jacobian();
    const Eigen::Index nv = mechanism.velocities();
    allowed_ = MatrixXd::Identity(nv, nv);
    if (j.rows() > 0) {
      const Eigen::FullPivLU<MatrixXd> lu(j);
      allowed_ = lu.kernel();
    }
    place_.resize(static_cast<std::size_t>(mechanism.dofs()));
    state_.v = allowed_ * impact(0.0);
    for (int i = 0; i < mechanism.dofs(); ++i) settle(i);
  }

  void advance(double h) {
    double left = h;
    for (int events = 0; left > 0.0 && events < 1000; ++events) {
      const State before = state_;
      State after = moved(before, left);
      if (!has_event(after)) {
        state_ = after, time_ += left;
        break;
      }
      double low = 0.0, high = left;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (has_event(moved(before, middle)) ? high : low) = middle;
      }
      state_ = moved(before, high), time_ += high, left -= high;
      take_event();
    }
    for (int i = 0; i < mechanism_.dofs(); ++i) leave(i);
  }

  const State& state() const { return state_; }

 private:
  const Joint& joint(int i) const { return mechanism_.joint(i); }
  double speed(const State& state, int i) const { return state.v[mechanism_.root_velocities() + i]; }
  VectorXd direction(int i) const { return allowed_.row(mechanism_.root_velocities() + i).transpose(); }

  MatrixXd inertia(const State& state) const {
    MatrixXd mass = mechanism_.mass_matrix(state);
    mass.diagonal() += mechanism_.armature();
    return allowed_.transpose() * mass * allowed_;
  }

  VectorXd acceleration(const State& state, double time) {
    inputs_(time, acting_);
    VectorXd forces = mechanism_.joint_forces(state, acting_) - mechanism_.bias(state);
    Convex problem{inertia(state), {}, {}};
    for (int i = 0; i < mechanism_.dofs(); ++i) {
      const int k = mechanism_.root_velocities() + i;
      const Place& place = place_[static_cast<std::size_t>(i)];
      const double servo = mechanism_.kp()[k] * (acting_.position_targets[i] - state.q[i]) +
                           mechanism_.kd()[k] * (acting_.velocity_targets[i] - state.v[k]) + acting_.efforts[i];
      forces[k] += std::clamp(servo, -joint(i).effort_limit, joint(i).effort_limit) - servo;
      forces[k] -= place.direction * joint(i).friction;
      const double low = place.end < 0 || place.fastest < 0 ? 0.0 : -infinity,
                   high = place.end > 0 || place.fastest > 0 ? 0.0 : infinity;
      if (low == 0.0 || high == 0.0) problem.curves.push_back({direction(i), interval_pieces(low, high, 0.0)});
      if (place.direction == 0 && place.fastest == 0 && joint(i).friction > 0.0)
        problem.curves.push_back({direction(i), box_pieces(0.0, joint(i).friction, 0.0)});
    }
    problem.momentum = allowed_.transpose() * forces;
    if (problem.curves.empty()) return allowed_ * problem.hessian.llt().solve(problem.momentum);
    return allowed_ * minimum(problem).v;
  }

  State moved(const State& from, double h) {
    struct Rate {
      VectorXd q, v;
    };
    const Eigen::Index first = mechanism_.root_velocities(), dofs = mechanism_.dofs();
    const auto rate = [&](double share, const Rate& by) {
      State at = from;
      if (by.q.size() > 0) at.q += share * h * by.q, at.v += share * h * by.v;
      return Rate{at.v.segment(first, dofs), acceleration(at, time_ + share * h)};
    };
    const Rate a = rate(0.0, {}), b = rate(0.5, a), c = rate(0.5, b), d = rate(1.0, c);
    State to = from;
    to.q += h / 6.0 * (a.q + 2.0 * b.q + 2.0 * c.q + d.q);
    to.v += h / 6.0 * (a.v + 2.0 * b.v + 2.0 * c.v + d.v);
    return to;
  }

  bool arrives(const State& state, int i) const {
    const Place& place = place_[static_cast<std::size_t>(i)];
    return (place.end >= 0 && state.q[i] < joint(i).lower && speed(state, i) < 0.0) ||
           (place.end <= 0 && state.q[i] > joint(i).upper && speed(state, i) > 0.0);
  }
  bool stops(const State& state, int i) const {
    const Place& place = place_[static_cast<std::size_t>(i)];
    return joint(i).friction > 0.0 && place.direction * speed(state, i) < 0.0;
  }
  bool too_fast(const State& state, int i) const {
    const Place& place = place_[static_cast<std::size_t>(i)];
    return place.fastest == 0 && std::abs(speed(state, i)) > joint(i).velocity_limit;
  }
  bool has_event(const State& state) const {
    for (int i = 0; i < mechanism_.dofs(); ++i)
      if (arrives(state, i) || stops(state, i) || too_fast(state, i)) return true;
    return false;
  }

  // Independent velocities after an impact at the present state.
  VectorXd impact(double restitution_share) {
    Convex problem{inertia(state_), {}, {}};
    problem.momentum =
        problem.hessian * (allowed_.transpose() * allowed_).ldlt().solve(allowed_.transpose() * state_.v);
    for (int i = 0; i < mechanism_.dofs(); ++i) {
      const double v = speed(state_, i), most = joint(i).velocity_limit;
      double low = -most, high = most, back = -restitution_share * joint(i).restitution * v;
      if (std::abs(back) < at_rest) back = 0.0;
      if (state_.q[i] <= joint(i).lower + 1e-12 && v <= at_rest) low = std::max(low, std::max(back, 0.0));
      if (state_.q[i] >= joint(i).upper - 1e-12 && v >= -at_rest) high = std::min(high, std::min(back, 0.0));
      const Place& place = place_[static_cast<std::size_t>(i)];
      if (joint(i).friction > 0.0 && (stops(state_, i) || (place.direction == 0 && std::abs(v) < at_rest)) &&
          restitution_share == 0.0)
        low = high = std::clamp(0.0, low, high);
      if (low > -infinity || high < infinity) problem.curves.push_back({direction(i), interval_pieces(low, high, 0.0)});
    }
    if (problem.curves.empty()) return problem.hessian.llt().solve(problem.momentum);
    return minimum(problem).v;
  }

  void take_event() {
    bool lands = false;
    for (int i = 0; i < mechanism_.dofs(); ++i) lands = lands || arrives(state_, i);
    for (int i = 0; i < mechanism_.dofs(); ++i)
      if (arrives(state_, i)) state_.q[i] = std::clamp(state_.q[i], joint(i).lower, joint(i).upper);
    state_.v = allowed_ * impact(lands ? 1.0 : 0.0);
    for (int i = 0; i < mechanism_.dofs(); ++i) settle(i);
  }

  void settle(int i) {
    Place& place = place_[static_cast<std::size_t>(i)];
    const double v = speed(state_, i);
    const bool still = std::abs(v) < at_rest;
    place.end = !still ? 0 : state_.q[i] <= joint(i).lower + 1e-12 ? -1 : state_.q[i] >= joint(i).upper - 1e-12 ? 1 : 0;
    place.fastest = std::abs(v) < joint(i).velocity_limit - at_rest ? 0 : v > 0.0 ? 1 : -1;
    place.direction = still ? 0 : v > 0.0 ? 1 : -1;
  }

  // A joint that was at rest, or at its fastest, and is no longer.
  void leave(int i) {
    Place& place = place_[static_cast<std::size_t>(i)];
    const double v = speed(state_, i);
    if (std::abs(v) > at_rest) {
      place.end = 0;
      if (place.direction == 0) place.direction = v > 0.0 ? 1 : -1;
    }
    if (place.fastest != 0 && std::abs(v) < joint(i).velocity_limit - at_rest) place.fastest = 0;
  }

  const Mechanism& mechanism_;
  const InputsOverTime& inputs_;
  Inputs acting_;
  State state_;
  double time_ = 0.0;
  MatrixXd allowed_;
  std::vector<Place> place_;
};

}  // namespace

Motion integrate_with_events(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs,
                             double interval, int intervals, int steps) {
  Events events(mechanism, start, inputs);
  Motion motion;
  motion.times = VectorXd::LinSpaced(intervals + 1, 0.0, interval * intervals);
  motion.positions.resize(intervals + 1, mechanism.dofs());
  motion.positions.row(0) = start.q;
  for (int i = 0; i < intervals; ++i) {
    for (int k = 0; k < steps; ++k) events.advance(interval / steps);
    motion.positions.row(i + 1) = events.state().q;
  }
  motion.end = events.state();
  return motion;
}

}  // namespace lockstep::reference
