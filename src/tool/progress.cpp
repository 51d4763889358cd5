// SPDX-License-Identifier: Apache-2.0
#include "progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "text.h"

namespace lockstep::tool {
namespace {

std::string duration(double seconds) {
  if (seconds < 60.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 3600.0)
    return fmt::format("{:.0f} min {:02.0f} s", std::floor(seconds / 60.0), std::floor(std::fmod(seconds, 60.0)));
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

}  // namespace

Progress::Progress(double total, std::string unit)
    : total_(total), unit_(std::move(unit)), shown_(isatty(STDERR_FILENO) == 1), start_(Clock::now()), drawn_(start_) {}

Progress::~Progress() {
  if (shown_ && drawn_ != start_) std::fputs("\r\033[K", stderr);
}

void Progress::update(double done) {
  if (!shown_) return;
  const Clock::time_point now = Clock::now();
  if (now - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::fputs(("\r" + progress_line(done, total_, seconds, unit_) + "\033[K").c_str(), stderr);
  std::fflush(stderr);
}

std::string progress_line(double done, double total, double seconds, const std::string& unit) {
  constexpr int width = 30;
  const double share = total > 0.0 ? std::clamp(done / total, 0.0, 1.0) : 1.0;
  const int filled = static_cast<int>(share * width);
  std::string line =
      fmt::format("[{}{}] {:3.0f} %", std::string(filled, '#'), std::string(width - filled, '.'), 100.0 * share);
  if (done > 0.0 && seconds > 0.0)
    line += fmt::format("  {} {}/s  {} left", with_prefix(done / seconds), unit, duration(seconds / share - seconds));
  return line;
}

}  // namespace lockstep::tool
