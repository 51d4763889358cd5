// SPDX-License-Identifier: Apache-2.0
#include "totals.h"

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace lockstep::soak {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Largest, value, seed)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Gentle, starts, faults, coupling_error, beyond_limit, beyond, looked, gain, gains,
                                   audited)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Totals, next_seed, models, steps, resets, saves, compared_steps, refused, ways,
                                   features, faults, gentle, reasons, failures, cpu_seconds, memory_early, memory)

namespace {

constexpr std::size_t most_words = 100;  // reasons and failures that are kept

void add_counts(Counts& to, const Counts& from) {
  for (const auto& [name, count] : from) to[name] += count;
}

void add_words(std::vector<std::string>& to, const std::vector<std::string>& from) {
  for (const std::string& words : from)
    if (to.size() < most_words) to.push_back(words);
}

}  // namespace

void Totals::add(const Totals& other) {
  models += other.models, steps += other.steps, resets += other.resets, saves += other.saves;
  compared_steps += other.compared_steps;
  add_counts(refused, other.refused), add_counts(ways, other.ways), add_counts(features, other.features);
  add_counts(faults, other.faults);
  for (int p = 0; p < 2; ++p) {
    const Gentle& from = other.gentle[p];
    gentle[p].starts += from.starts, gentle[p].beyond += from.beyond, gentle[p].looked += from.looked;
    gentle[p].gains += from.gains, gentle[p].audited += from.audited;
    add_counts(gentle[p].faults, from.faults);
    gentle[p].coupling_error.add(from.coupling_error), gentle[p].beyond_limit.add(from.beyond_limit);
    gentle[p].gain.add(from.gain);
  }
  add_words(reasons, other.reasons), add_words(failures, other.failures);
}

std::string to_json(const Totals& totals) { return nlohmann::json(totals).dump(1) + '\n'; }

Totals load(const std::string& path) {
  std::ifstream file(path);
  try {
    return nlohmann::json::parse(file).get<Totals>();
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(path + ": is no state of a soak (" + error.what() + "); name another file");
  }
}

void save(const Totals& totals, const std::string& path) {
  const std::string unfinished = path + ".new";
  std::ofstream file(unfinished);
  file << to_json(totals);
  file.close();
  if (!file || std::rename(unfinished.c_str(), path.c_str()) != 0)
    throw std::runtime_error(path + ": cannot be written; see the space and the permissions there");
}

}  // namespace lockstep::soak
