// How far a contender is from the exact motion, and how fast it is. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "peer.h"
#include "scenes/scenes.h"

namespace lockstep::peers {

inline constexpr double interval = 1.0 / 240;  ///< s, the step of every contender

/// A scene and the beginning of its exact motion.
class Yardstick {
 public:
  Yardstick(const std::string& scene, int intervals);

  const scenes::Scene& scene() const { return scene_; }
  bool driven() const { return driven_; }
  int intervals() const { return static_cast<int>(truth_.rows()) - 1; }
  Eigen::VectorXd truth(int row) const { return truth_.row(row); }  ///< after so many intervals
  double coupling_error(const Eigen::VectorXd& positions) const;    ///< largest |C|

 private:
  scenes::Scene scene_;
  bool driven_ = false;
  Eigen::MatrixXd truth_;
};

struct Verdict {
  double rms = 0.0;        ///< rad, of all joints over the yardstick; infinite if diverged before its end
  double largest_c = 0.0;  ///< rad, over all the time
  bool diverged = false;   ///< no number, or beyond 100 rad, or the engine gave up
};

/// Targets are renewed for each call of step(). Past the yardstick's end it is only |C| that is looked at, until
/// `seconds` in all or as long as `patience`, CPU time in s, lasts.
Verdict judge(const Contender& contender, const Yardstick& yardstick, double seconds, double patience);

/// Largest distance from the yardstick with steps 64 times as small, as a share of the way that its joints move: small
/// where the contender is the same mechanism.
double distance_at_small_steps(const Contender& contender, const Yardstick& yardstick);

/// Environment-steps per second of CPU time, one thread; keeps its environments from one measurement to the next.
class Stopwatch {
 public:
  Stopwatch(const Contender& contender, const Yardstick& yardstick);
  double measure(double seconds);

 private:
  const Yardstick* yardstick_;
  int environments_, steps_per_call_;
  int done_ = 0;  // steps since the start
  std::unique_ptr<Peer> peer_;
};

}  // namespace lockstep::peers
