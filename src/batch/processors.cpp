// SPDX-License-Identifier: Apache-2.0
//
// oneTBB counts the processors of the affinity mask, but it does not know the quota of control groups: in a container
// that may use two processors of 64 it would have 64 threads, which all wait for the rest of each period.
#include "processors.h"

#include <tbb/info.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <string>

namespace lockstep {
namespace {

namespace fs = std::filesystem;

constexpr double unlimited_quota = std::numeric_limits<double>::infinity();

// Of a group that says "max" or a negative number, or nothing: infinity.
double quota_of(double quota, double period) { return quota > 0.0 && period > 0.0 ? quota / period : unlimited_quota; }

double number_in(const fs::path& file) {
  double number = -1.0;
  std::ifstream(file) >> number;
  return number;
}

double quota_v2(const fs::path& group) {
  std::ifstream file(group / "cpu.max");  // "200000 100000" or "max 100000"
  double quota = -1.0, period = -1.0;
  file >> quota >> period;
  return quota_of(quota, period);
}

double quota_v1(const fs::path& group) {
  return quota_of(number_in(group / "cpu.cfs_quota_us"), number_in(group / "cpu.cfs_period_us"));
}

// The smallest quota of a group and of those above it. In a container the path may be that of the host, of which the
// mount has only the last group, as its root.
double smallest(const fs::path& mount, const std::string& group, double (*quota)(const fs::path&)) {
  double least = quota(mount);
  fs::path place = mount;
  std::error_code ignored;
  for (const fs::path& part : fs::path(group).relative_path()) {
    place /= part;
    if (!fs::is_directory(place, ignored)) break;
    least = std::min(least, quota(place));
  }
  return least;
}

}  // namespace

double processor_quota(const fs::path& root) {
  double least = unlimited_quota;
  std::ifstream groups(root / "proc/self/cgroup");  // lines "ID:CONTROLLERS:PATH", no controllers in v2
  const fs::path mounts = root / "sys/fs/cgroup";
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",",
                      group = line.substr(second + 1);
    if (controllers == ",,")
      least = std::min(least, smallest(mounts, group, quota_v2));
    else if (controllers.find(",cpu,") != std::string::npos)
      for (const char* mount : {"cpu", "cpu,cpuacct"})
        least = std::min(least, smallest(mounts / mount, group, quota_v1));
  }
  return least;
}

int usable_processors() {
  const double quota = std::ceil(processor_quota());
  const int allowed = tbb::info::default_concurrency();
  return quota < allowed ? std::max(1, static_cast<int>(quota)) : allowed;
}

}  // namespace lockstep
