// What a soak has counted, and its file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace lockstep::soak {

/// The largest number that was seen, and the model that it is of.
struct Largest {
  double value = 0.0;
  std::uint64_t seed = 0;
  void add(double number, std::uint64_t from) {
    if (number > value) value = number, seed = from;
  }
  void add(const Largest& other) { add(other.value, other.seed); }
};

using Counts = std::map<std::string, std::uint64_t>;

/// In gentle motion, in one precision.
struct Gentle {
  std::uint64_t starts = 0;   ///< of environments
  Counts faults;              ///< environments, by fault and stage
  Largest coupling_error;     ///< of couplings that are eliminated, rad or m
  Largest beyond_limit;       ///< of a joint with a hard range, rad or m
  std::uint64_t beyond = 0;   ///< environments of 1e-3 or more, each time that they were looked at
  std::uint64_t looked = 0;   ///< environments that were looked at
  Largest gain;               ///< of energy that nothing put in, by that at hand
  std::uint64_t gains = 0;    ///< environments whose gain is 0.1 or more
  std::uint64_t audited = 0;  ///< environments whose energy was looked at
};

struct Totals {
  std::uint64_t next_seed = 0, models = 0, steps = 0, resets = 0, saves = 0, compared_steps = 0;
  Counts refused;                     ///< models, by the code of the error
  Counts ways;                        ///< models, by integrator and engine
  Counts features;                    ///< models that have it
  Counts faults;                      ///< environments, by fault, in all motions
  Gentle gentle[2];                   ///< single, double
  std::vector<std::string> reasons;   ///< of the first faults in gentle motion, in words
  std::vector<std::string> failures;  ///< promises that were broken
  double cpu_seconds = 0.0;
  double memory_early = 0.0, memory = 0.0;  ///< MB that are resident: after 200 models of this run, and now

  void add(const Totals& other);
};

std::string to_json(const Totals& totals);

/// Throws std::runtime_error for a file that save() has not written.
Totals load(const std::string& path);
void save(const Totals& totals, const std::string& path);

}  // namespace lockstep::soak
