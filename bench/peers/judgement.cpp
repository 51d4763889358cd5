// SPDX-License-Identifier: Apache-2.0
#include "judgement.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../peak.h"
#include "reference/truth.h"

namespace lockstep::peers {
namespace {

using bench::cpu_seconds;

constexpr double diverged_beyond = 100.0;  // rad: no scene comes near it

// Runge-Kutta 4 has to resolve the servos of the gripper, 2e4 /s. With half as many steps the others are exact to
// 1e-11 rad.
int steps_of_truth(const std::string& scene) { return scene == "gripper13" ? 64 : 32; }

// Sets the energy and momentum of the verdict. The peer must be at the yardstick's end.
void judge_conservation(const Peer& peer, const Yardstick& yardstick, Verdict& verdict) {
  const reference::Mechanism& mechanism = yardstick.mechanism();
  const std::optional<reference::State> state = peer.state();
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  verdict.energy = verdict.momentum = unknown;
  if (!state) return;
  const auto energy = [&](const reference::State& s) {
    return mechanism.kinetic_energy(s) + mechanism.potential_energy(s);
  };
  const reference::State start = mechanism.initial_state();
  const double exact = energy(yardstick.truth_end());
  verdict.energy = std::abs(energy(*state) - exact) / std::max(std::abs(exact), std::abs(energy(start)));
  if (mechanism.root_velocities() > 0)
    verdict.momentum = (mechanism.momentum(*state) - mechanism.momentum(start)).cwiseAbs().maxCoeff();
}

}  // namespace

Yardstick::Yardstick(const std::string& name, int intervals)
    : Yardstick(scenes::scene(name), intervals, steps_of_truth(name)) {
  require_plain(scene_.model);
}

Yardstick::Yardstick(const Model& model, int intervals)
    : Yardstick(scenes::Scene{model.name, model, {}}, intervals, steps_of_truth(model.name)) {}

Yardstick::Yardstick(scenes::Scene scene, int intervals, int steps_per_interval)
    : scene_(std::move(scene)), mechanism_(scene_.model) {
  for (const Joint& joint : scene_.model.joints) driven_ = driven_ || joint.drive.kp > 0.0;
  const auto targets = [&](double t, reference::Inputs& inputs) {
    if (driven_) inputs.position_targets = scene_.targets(t);
  };
  const reference::State start = mechanism_.initial_state();
  reference::Motion motion = reference::integrate(mechanism_, start, targets, interval, intervals, steps_per_interval);
  truth_ = std::move(motion.positions);
  end_ = std::move(motion.end);
}

std::vector<Eigen::VectorXd> Yardstick::targets(double time, double dt, const Peer& peer) const {
  std::vector<Eigen::VectorXd> all;
  if (!driven_) return all;
  for (const double share : peer.target_times()) all.push_back(scene_.targets(time + share * dt));
  return all;
}

void set_targets(const std::vector<Eigen::VectorXd>& targets, Peer& peer) {
  for (std::size_t i = 0; i < targets.size(); ++i) peer.set_targets_at(static_cast<int>(i), targets[i]);
}

double Yardstick::coupling_error(const Eigen::VectorXd& positions) const {
  const Model& model = scene_.model;
  double largest = 0.0;
  for (const Coupling& coupling : model.couplings) {
    double error = positions[mechanism_.dof(coupling.joint)] + coupling.offset;
    for (const CouplingTerm& term : coupling.terms) error += term.ratio * positions[mechanism_.dof(term.joint)];
    largest = std::max(largest, std::abs(error));
  }
  return largest;
}

Verdict judge(const Contender& contender, const Yardstick& yardstick, double seconds, double patience,
              int steps_per_second) {
  const double begun = cpu_seconds(), dt = 1.0 / steps_per_second;
  const auto peer = contender.make(yardstick.scene().model, dt, 1);
  const int steps = static_cast<int>(std::lround(seconds * steps_per_second));
  // The row of the truth at the end of this step, or -1 if there is none.
  const auto row_after = [&](int done) {
    return done * rows_per_second % steps_per_second == 0 ? done * rows_per_second / steps_per_second : -1;
  };
  Verdict verdict;
  double squares = 0.0;
  long compared = 0;
  for (int done = 0; done < steps;) {
    set_targets(yardstick.targets(done * dt, dt, *peer), *peer);
    peer->step();
    done += contender.steps_per_call;
    const Eigen::VectorXd q = peer->positions();
    verdict.diverged = peer->failed() || !q.allFinite() || q.cwiseAbs().maxCoeff() > diverged_beyond;
    if (verdict.diverged) break;
    verdict.largest_c = std::max(verdict.largest_c, yardstick.coupling_error(q));
    const int row = row_after(done);
    if (row > yardstick.intervals() || row < 0) {
      if (row > 0 && cpu_seconds() - begun > patience) break;
      continue;
    }
    squares += (q - yardstick.truth(row)).squaredNorm();
    compared += q.size();
    if (row == yardstick.intervals()) judge_conservation(*peer, yardstick, verdict);
  }
  const int rows = yardstick.intervals() / (contender.steps_per_call * std::max(1, rows_per_second / steps_per_second));
  verdict.rms =
      compared >= rows * yardstick.truth(0).size() ? std::sqrt(squares / static_cast<double>(compared)) : infinity;
  return verdict;
}

double distance_at_small_steps(const Contender& contender, const Yardstick& yardstick) {
  constexpr int finer = 64;
  const auto peer = contender.make(yardstick.scene().model, interval / finer, 1);
  double farthest = 0.0, moved = 0.0;
  for (int done = 0; done < yardstick.intervals() * finer;) {
    if (yardstick.driven()) peer->set_targets(yardstick.scene().targets(done * interval / finer));
    peer->step();
    done += contender.steps_per_call;
    if (done % finer != 0) continue;
    const Eigen::VectorXd exact = yardstick.truth(done / finer);
    const double distance = (peer->positions() - exact).cwiseAbs().maxCoeff();
    if (!(distance < infinity)) return infinity;
    farthest = std::max(farthest, distance);
    moved = std::max(moved, (exact - yardstick.truth(0)).cwiseAbs().maxCoeff());
  }
  return farthest / moved;
}

Stopwatch::Stopwatch(const Contender& contender, const Yardstick& yardstick, int steps_per_second)
    : yardstick_(&yardstick),
      environments_(contender.environments),
      steps_per_call_(contender.steps_per_call),
      rate_(steps_per_second),
      peer_(contender.make(yardstick.scene().model, 1.0 / steps_per_second, contender.environments)) {}

double Stopwatch::measure(double seconds, double patience) {
  double spent = 0.0;
  long calls = 0;
  const auto motion_ends = [&] {
    return done_ * rows_per_second >= yardstick_->intervals() * rate_ || peer_->failed();
  };
  for (; spent < patience && !(spent >= seconds && motion_ends()); ++calls, done_ += steps_per_call_) {
    if (motion_ends()) {
      peer_->reset();
      done_ = 0;
    }
    const double dt = 1.0 / rate_;
    const std::vector<Eigen::VectorXd> targets = yardstick_->targets(done_ * dt, dt, *peer_);
    const double start = cpu_seconds();
    set_targets(targets, *peer_);
    peer_->step();
    spent += cpu_seconds() - start;
  }
  return static_cast<double>(calls) * steps_per_call_ * environments_ / spent;
}

}  // namespace lockstep::peers
