// Measures how far a contender is from the exact motion, and how fast it is. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "peer.h"
#include "scenes/scenes.h"

namespace lockstep::peers {

inline constexpr int rows_per_second = 240;
inline constexpr double interval = 1.0 / rows_per_second;  ///< s, between rows of the truth; peers.cpp steps by it

/// A scene and the beginning of its exact motion.
class Yardstick {
 public:
  Yardstick(const std::string& scene, int intervals);
  /// The same for any model, without moving targets. The peers must be able to express all of it.
  Yardstick(const Model& model, int intervals);

  const scenes::Scene& scene() const { return scene_; }
  bool driven() const { return driven_; }
  int intervals() const { return static_cast<int>(truth_.rows()) - 1; }
  Eigen::VectorXd truth(int row) const { return truth_.row(row); }  ///< after this many intervals
  const reference::State& truth_end() const { return end_; }        ///< after all intervals
  const reference::Mechanism& mechanism() const { return mechanism_; }
  /// The targets of a step of `dt` that begins at `time`, one for each of the peer's target_times(). Empty if the scene
  /// has none.
  std::vector<Eigen::VectorXd> targets(double time, double dt, const Peer& peer) const;
  double coupling_error(const Eigen::VectorXd& positions) const;  ///< largest |C|

 private:
  Yardstick(scenes::Scene scene, int intervals, int steps_per_interval);
  scenes::Scene scene_;
  reference::Mechanism mechanism_;
  bool driven_ = false;
  reference::State end_;
  Eigen::MatrixXd truth_;
};

struct Verdict {
  double rms = 0.0;        ///< rad, of all joints over the yardstick; infinite if the run diverged before its end
  double largest_c = 0.0;  ///< rad, over the whole run
  /// Error at the yardstick's end, as a share of the larger of the exact motion's energies at its start and end. NaN if
  /// the engine does not give its velocities.
  double energy = 0.0;
  /// Largest change of a component until the yardstick's end, N m s or N s. NaN if the root is fixed, or as for energy.
  double momentum = 0.0;
  bool diverged = false;  ///< NaN, or beyond 100 rad, or the engine gave up
};

void set_targets(const std::vector<Eigen::VectorXd>& targets, Peer& peer);

/// Runs the contender for `seconds`, with new targets for each call of step(). After the yardstick's end it measures
/// |C| alone, and stops early when it has used `patience` seconds of CPU time.
Verdict judge(const Contender& contender, const Yardstick& yardstick, double seconds, double patience,
              int steps_per_second = 240);

/// Largest distance from the yardstick with steps 64 times as small, as a share of the way that its joints move. It is
/// small if the contender is the same mechanism.
double distance_at_small_steps(const Contender& contender, const Yardstick& yardstick);

/// Measures environment-steps per second of CPU time on one thread. Steps differ in cost, so it takes the motion whose
/// accuracy is judged.
class Stopwatch {
 public:
  Stopwatch(const Contender& contender, const Yardstick& yardstick, int steps_per_second = 240);
  /// Steps for at least `seconds`, and to the end of a motion. Stops when it has used `patience` seconds; the next call
  /// goes on from there.
  double measure(double seconds, double patience);

 private:
  const Yardstick* yardstick_;
  int environments_, steps_per_call_, rate_;
  int done_ = 0;  // steps since the start
  std::unique_ptr<Peer> peer_;
};

}  // namespace lockstep::peers
