// A progress bar on the terminal. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>

namespace lockstep::tool {

/// One line on stderr, redrawn at most ten times a second and removed at the end. Silent if stderr is not a terminal.
class Progress {
 public:
  /// `unit` is what `total`, the work done and the rate count.
  Progress(double total, std::string unit);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(double done);

 private:
  using Clock = std::chrono::steady_clock;
  double total_;
  std::string unit_;
  bool shown_;
  Clock::time_point start_, drawn_;
};

/// The line itself: bar, share, rate, remaining time.
std::string progress_line(double done, double total, double seconds, const std::string& unit);

}  // namespace lockstep::tool
