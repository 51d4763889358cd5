// A batch that is looked at after every step. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "kernels.h"
#include "lockstep/plan.h"
#include "model/softness_numbers.h"
#include "physics.h"

namespace lockstep::stability {

constexpr double steps[] = {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 1000};

inline StepSettings recorded(double dt, Method method = Method::automatic) {
  StepSettings settings = physics::settings(method, 4, 1, dt);
  settings.record_diagnostics = true;
  return settings;
}

/// test(S{}) for both.
template <class Test>
void in_both_precisions(Test&& test) {
  for (int bits : {32, 64}) {
    SCOPED_TRACE(bits == 32 ? "float" : "double");
    bits == 32 ? test(float{}) : test(double{});
  }
}

/// test(S{}, dt) at all steps in both precisions.
template <class Test>
void at_all_steps(Test&& test) {
  in_both_precisions([&](auto scalar) {
    for (double dt : steps) {
      SCOPED_TRACE("step 1/" + std::to_string(std::lround(1.0 / dt)));
      test(scalar, dt);
    }
  });
}

/// test(S{}, dt, method) for the methods that solve all couplings exactly.
template <class Test>
void with_exact_methods(Test&& test) {
  at_all_steps([&](auto scalar, double dt) {
    for (Method method : {Method::automatic, Method::direct}) {
      SCOPED_TRACE(to_string(method));
      test(scalar, dt, method);
    }
  });
}

/// What a hard coupling may be off, rad or m.
template <class S>
constexpr double held = sizeof(S) == 4 ? 1e-5 : 1e-10;

/// Steps a batch and keeps the worst of what it saw, over all environments.
template <class S>
class Watch {
 public:
  Batch<S> batch;

  explicit Watch(const Plan& plan, int environments = 1) : batch(noted(plan), environments, options()) {
    expect_kernel(batch);
    excess_ = Eigen::ArrayXd::Zero(environments);
    start();
  }

  Watch(const Model& model, const StepSettings& settings, int environments = 1)
      : Watch(compile(model, settings), environments) {}

  /// Counts from the errors that the batch has now: for those who change its state or fields first.
  void start() {
    remaining_ = batch.coupling_errors().template cast<double>();
    error_ = late_error_ = beyond_rounding_ = 0.0;
    look();
  }

  /// `before` and `after` see every step; the first may set inputs for the time at its end.
  void run(double seconds, const std::function<void(double t)>& before = {}, const std::function<void()>& after = {}) {
    const double dt = batch.plan().settings().dt;
    for (int last = taken_ + static_cast<int>(std::lround(seconds / dt)); taken_ < last;) {
      if (before) before((taken_ + 1) * dt);
      batch.step();
      ++taken_;
      account();
      look();
      if (after) after();
    }
  }

  double time() const { return taken_ * batch.plan().settings().dt; }
  double position(int dof, int environment = 0) const { return batch.positions()(dof, environment); }
  double velocity(int dof, int environment = 0) const { return batch.velocities()(dof, environment); }

  bool finite() const { return finite_; }
  /// Largest |C| of a hard coupling beyond what is left of the one that it started with, (1 - erp)^n of it. The
  /// environments that were frozen by a fault do not count.
  double error() const { return error_; }
  /// The same where less than 1e-6 is left.
  double late_error() const { return late_error_; }
  /// error() less four units in the last place of the positions and offset that C is the sum of.
  double error_beyond_rounding() const { return beyond_rounding_; }
  /// Largest energy, J, that came from nowhere up to some time: what it changed by less all work and corrections.
  double excess() const { return excess_most_; }
  double speed() const { return batch.speeds().maxCoeff(); }

 private:
  void account() {
    const Model& model = batch.plan().model();
    for (Eigen::Index c = 0; c < remaining_.rows(); ++c)
      remaining_.row(c) *= 1.0 - numbers_of(model.couplings[static_cast<std::size_t>(c)].softness).first;
    if (!batch.plan().settings().record_diagnostics) return;
    const Eigen::ArrayXXd balance = batch.energy_balances().template cast<double>();
    excess_ += (balance.row(3) - balance.row(0) - balance.row(2)).transpose();
    excess_most_ = std::max(excess_most_, excess_.maxCoeff());
  }

  void look() {
    finite_ = finite_ && batch.positions().isFinite().all() && batch.velocities().isFinite().all() &&
              batch.root_poses().isFinite().all() && batch.root_velocities().isFinite().all();
    const Eigen::ArrayXXd errors = batch.coupling_errors().template cast<double>();
    const Model& model = batch.plan().model();
    for (Eigen::Index c = 0; c < errors.rows(); ++c) {
      const Coupling& coupling = model.couplings[static_cast<std::size_t>(c)];
      if (!is_hard(coupling.softness) || coupling.force_limit < infinity) continue;
      for (Eigen::Index e = 0; e < errors.cols(); ++e) {
        if (batch.faults()[static_cast<std::size_t>(e)] != Fault::none) continue;
        const double error = std::abs(errors(c, e) - remaining_(c, e));
        error_ = std::max(error_, error);
        beyond_rounding_ = std::max(beyond_rounding_, error - last_places(coupling, e));
        if (std::abs(remaining_(c, e)) < 1e-6) late_error_ = std::max(late_error_, error);
      }
    }
  }

  double last_places(const Coupling& coupling, Eigen::Index environment) const {
    const auto size = [&](const std::string& joint) {
      return std::abs(static_cast<double>(batch.positions()(batch.plan().dof(joint), environment)));
    };
    double sum = size(coupling.joint) + std::abs(coupling.offset);
    for (const CouplingTerm& term : coupling.terms) sum += std::abs(term.ratio) * size(term.joint);
    return 4.0 * std::numeric_limits<S>::epsilon() * sum;
  }

  Eigen::ArrayXXd remaining_;
  Eigen::ArrayXd excess_;
  bool finite_ = true;
  int taken_ = 0;
  double error_ = 0.0, late_error_ = 0.0, beyond_rounding_ = 0.0, excess_most_ = 0.0;
};

/// The promises of every scene that is possible: numbers, no fault, couplings that hold, energy within its budget.
/// Errors at the start decay as erp says; `direct`, which adds impulses to a free velocity, is exact in this when they
/// have decayed, and on the way to what that velocity is rounded to.
template <class S>
void expect_sound(const Watch<S>& watch, double energy, double tolerance = held<S>) {
  EXPECT_TRUE(watch.finite());
  EXPECT_EQ(watch.batch.faulted(), 0) << to_string(watch.batch.faults()[0]);
  EXPECT_LE(watch.late_error(), tolerance);
  EXPECT_LE(watch.error(), watch.batch.plan().method() == Method::reduced ? tolerance : 10.0 * tolerance);
  EXPECT_LE(watch.excess(), energy);
}

}  // namespace lockstep::stability
