// SPDX-License-Identifier: Apache-2.0
#include "judgement.h"

#include <cmath>

#include "../peak.h"
#include "reference/truth.h"

namespace lockstep::peers {
namespace {

using bench::cpu_seconds;

constexpr double lost = 100.0;  // rad: no scene comes near it

// Runge-Kutta 4 has to resolve the servos of the gripper, 2e4 /s.
int steps_of_truth(const std::string& scene) { return scene == "gripper13" ? 64 : 8; }

}  // namespace

Yardstick::Yardstick(const std::string& name, int intervals) : scene_(scenes::scene(name)) {
  require_plain(scene_.model);
  for (const Joint& joint : scene_.model.joints) driven_ = driven_ || joint.drive.kp > 0.0;
  const reference::Mechanism mechanism(scene_.model);
  const auto targets = [&](double t, reference::Inputs& inputs) { inputs.position_targets = scene_.targets(t); };
  const reference::State start = mechanism.initial_state();
  truth_ = reference::integrate(mechanism, start, targets, interval, intervals, steps_of_truth(name)).positions;
}

double Yardstick::coupling_error(const Eigen::VectorXd& positions) const {
  const Model& model = scene_.model;
  double largest = 0.0;
  for (const Coupling& coupling : model.couplings) {
    double error = positions[model.joint_index(coupling.joint)] + coupling.offset;
    for (const CouplingTerm& term : coupling.terms) error += term.ratio * positions[model.joint_index(term.joint)];
    largest = std::max(largest, std::abs(error));
  }
  return largest;
}

Verdict judge(const Contender& contender, const Yardstick& yardstick, double seconds, double patience) {
  const double begun = cpu_seconds();
  const auto peer = contender.make(yardstick.scene().model, interval, 1);
  const int steps = static_cast<int>(std::lround(seconds / interval));
  Verdict verdict;
  double squares = 0.0;
  long compared = 0;
  for (int done = 0; done < steps;) {
    if (yardstick.driven()) peer->set_targets(yardstick.scene().targets(done * interval));
    peer->step();
    done += contender.steps_per_call;
    const Eigen::VectorXd q = peer->positions();
    verdict.diverged = peer->failed() || !q.allFinite() || q.cwiseAbs().maxCoeff() > lost;
    if (verdict.diverged) break;
    verdict.largest_c = std::max(verdict.largest_c, yardstick.coupling_error(q));
    if (done > yardstick.intervals()) {
      if (cpu_seconds() - begun > patience) break;
      continue;
    }
    squares += (q - yardstick.truth(done)).squaredNorm();
    compared += q.size();
  }
  const bool whole = compared >= yardstick.intervals() / contender.steps_per_call * yardstick.truth(0).size();
  verdict.rms = whole ? std::sqrt(squares / static_cast<double>(compared)) : infinity;
  return verdict;
}

double distance_at_small_steps(const Contender& contender, const Yardstick& yardstick) {
  constexpr int finer = 64;
  const auto peer = contender.make(yardstick.scene().model, interval / finer, 1);
  double far = 0.0, moved = 0.0;
  for (int done = 0; done < yardstick.intervals() * finer;) {
    if (yardstick.driven()) peer->set_targets(yardstick.scene().targets(done * interval / finer));
    peer->step();
    done += contender.steps_per_call;
    if (done % finer != 0) continue;
    const Eigen::VectorXd exact = yardstick.truth(done / finer);
    const double distance = (peer->positions() - exact).cwiseAbs().maxCoeff();
    if (!(distance < infinity)) return infinity;
    far = std::max(far, distance);
    moved = std::max(moved, (exact - yardstick.truth(0)).cwiseAbs().maxCoeff());
  }
  return far / moved;
}

Stopwatch::Stopwatch(const Contender& contender, const Yardstick& yardstick)
    : yardstick_(&yardstick), environments_(contender.environments), steps_per_call_(contender.steps_per_call),
      peer_(contender.make(yardstick.scene().model, interval, contender.environments)) {}

double Stopwatch::measure(double seconds) {
  double spent = 0.0;
  long calls = 0;
  for (; calls == 0 || spent < seconds; ++calls, done_ += steps_per_call_) {
    if (done_ >= yardstick_->intervals() || peer_->failed()) {  // the motion whose accuracy is told, once more
      peer_->reset();
      done_ = 0;
    }
    const Eigen::VectorXd targets = yardstick_->scene().targets(done_ * interval);
    const double start = cpu_seconds();
    if (yardstick_->driven()) peer_->set_targets(targets);
    peer_->step();
    spent += cpu_seconds() - start;
  }
  return static_cast<double>(calls) * steps_per_call_ * environments_ / spent;
}

}  // namespace lockstep::peers
