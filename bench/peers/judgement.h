// How far a contender is from the exact motion, and how fast it is. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "peer.h"
#include "scenes/scenes.h"

namespace lockstep::peers {

inline constexpr int rows_per_second = 240;
inline constexpr double interval =
    1.0 / rows_per_second;  ///< s, the step of every contender but where rates are charted

/// A scene and the beginning of its exact motion.
class Yardstick {
 public:
  Yardstick(const std::string& scene, int intervals);
  /// The same of any model, as it starts and without moving targets; for peers that have words for all of it.
  Yardstick(const Model& model, int intervals);

  const scenes::Scene& scene() const { return scene_; }
  bool driven() const { return driven_; }
  int intervals() const { return static_cast<int>(truth_.rows()) - 1; }
  Eigen::VectorXd truth(int row) const { return truth_.row(row); }  ///< after so many intervals
  const reference::State& truth_end() const { return end_; }        ///< after all of them
  const reference::Mechanism& mechanism() const { return mechanism_; }
  /// The targets of a step of `dt` that begins at `time`, by the peer's target_times(); none if the scene has none.
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
  double rms = 0.0;        ///< rad, of all joints over the yardstick; infinite if diverged before its end
  double largest_c = 0.0;  ///< rad, over all the time
  double energy =
      0.0;  ///< error at the yardstick's end, share of the larger of the exact motion's two; NaN if not told
  double momentum = 0.0;  ///< change of a floating mechanism's until then, N m s or N s, largest component; the same
  bool diverged = false;  ///< no number, or beyond 100 rad, or the engine gave up
};

void set_targets(const std::vector<Eigen::VectorXd>& targets, Peer& peer);

/// Targets are renewed for each call of step(). Past the yardstick's end it is only |C| that is looked at, until
/// `seconds` in all or as long as `patience`, CPU time in s, lasts.
Verdict judge(const Contender& contender, const Yardstick& yardstick, double seconds, double patience,
              int steps_per_second = 240);

/// Largest distance from the yardstick with steps 64 times as small, as a share of the way that its joints move: small
/// where the contender is the same mechanism.
double distance_at_small_steps(const Contender& contender, const Yardstick& yardstick);

/// Environment-steps per second of CPU time, one thread, over the motion whose accuracy is told: steps differ in cost.
class Stopwatch {
 public:
  Stopwatch(const Contender& contender, const Yardstick& yardstick, int steps_per_second = 240);
  /// Whole motions for `seconds` at least; when patience ends, in s, it stops, to go on from there another time.
  double measure(double seconds, double patience);

 private:
  const Yardstick* yardstick_;
  int environments_, steps_per_call_, rate_;
  int done_ = 0;  // steps since the start
  std::unique_ptr<Peer> peer_;
};

}  // namespace lockstep::peers
