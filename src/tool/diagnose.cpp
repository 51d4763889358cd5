// SPDX-License-Identifier: Apache-2.0
#include "diagnose.h"

#include <algorithm>
#include <limits>

#include "run.h"

namespace lockstep::tool {
namespace {

// Rows of Batch::energy_balances().
enum Balance { work_of_drives, dissipated, work_of_corrections, energy_change };

// What is known of one environment so far.
struct Watched {
  double energy_excess = 0.0;  // since the start
  bool had_conflict = false;
};

template <class S>
void diagnose_step(const Batch<S>& batch, double time, std::vector<Watched>& watched, Diagnosis& diagnosis) {
  const bool recorded = batch.plan().settings().record_diagnostics;
  const typename Batch<S>::Array violations = batch.limit_violations(), speeds = batch.speeds();
  const typename Batch<S>::Array balances = recorded ? batch.energy_balances() : typename Batch<S>::Array();
  for (int e = 0; e < batch.environments(); ++e) {
    if (batch.faults()[e] != Fault::none) continue;
    Watched& environment = watched[e];
    diagnosis.limit_violation_max = std::max(diagnosis.limit_violation_max, static_cast<double>(violations(0, e)));
    diagnosis.speed_max = std::max(diagnosis.speed_max, static_cast<double>(speeds(0, e)));
    if (!recorded) continue;
    // In double: a step adds little to the sum.
    const auto joules = [&](Balance row) { return static_cast<double>(balances(row, e)); };
    environment.energy_excess += joules(energy_change) - joules(work_of_drives) - joules(work_of_corrections);
    diagnosis.energy_excess_max = std::max(diagnosis.energy_excess_max, environment.energy_excess);

    if (environment.had_conflict) continue;
    std::vector<std::string> rows = batch.conflicts(e);
    if (rows.empty()) continue;
    environment.had_conflict = true;
    if (++diagnosis.conflict_count <= most_conflicts_listed)
      diagnosis.conflicts.push_back({static_cast<int>(batch.ids()[e]), time, std::move(rows)});
  }
}

// Adds a step's contacts. `pressing` counts the pairs.
template <class S>
void diagnose_contacts(const Batch<S>& batch, typename Batch<S>::Array& numbers, long& pressing, Diagnosis& diagnosis) {
  static const Query queries[] = {
      {Quantity::contact_gap}, {Quantity::contact_slip}, {Quantity::contact_normal_force}, {Quantity::solve_counts}};
  const auto pairs = static_cast<Eigen::Index>(batch.plan().contacts().size());
  numbers.resize(3 * pairs + batch.plan().query_rows({Quantity::solve_counts}), batch.environments());
  batch.read(queries, {numbers.data(), batch.environments(), 1});
  for (int e = 0; e < batch.environments(); ++e) {
    if (batch.faults()[e] != Fault::none) continue;
    for (Eigen::Index p = 0; p < pairs; ++p) {
      diagnosis.penetration_max = std::max(diagnosis.penetration_max, -static_cast<double>(numbers(p, e)));
      diagnosis.slip_max = std::max(diagnosis.slip_max, static_cast<double>(numbers(pairs + p, e)));
      pressing += numbers(2 * pairs + p, e) > S(0);
    }
    const auto count = [&](Eigen::Index row) { return static_cast<double>(numbers(3 * pairs + row, e)); };
    diagnosis.near_mean += count(1), diagnosis.points_mean += count(2);
    diagnosis.rounds_mean += count(6), diagnosis.tile_rounds_mean += count(9);
  }
}

// Solves at their cap since the start.
template <class S>
long unfinished(const Batch<S>& batch) {
  static const Query query{Quantity::unfinished_contacts};
  typename Batch<S>::Array counts(1, batch.environments());
  batch.read(std::span(&query, 1), {counts.data(), batch.environments(), 1});
  return static_cast<long>(counts.sum());
}

}  // namespace

template <class S>
Diagnosis diagnose(Batch<S>& batch, const Targets& targets, long steps) {
  const double dt = batch.plan().settings().dt;
  Diagnosis diagnosis;
  diagnosis.environments = batch.environments();
  if (!batch.plan().settings().record_diagnostics)
    diagnosis.energy_excess_max = std::numeric_limits<double>::quiet_NaN();
  std::vector<Watched> watched(batch.environments());
  typename Batch<S>::Array contacts;
  long pressing = 0;
  const bool touches = !batch.plan().contacts().empty();
  advance(batch, targets, steps, 1, [&](long done) {
    diagnose_step(batch, static_cast<double>(done) * dt, watched, diagnosis);
    if (touches) diagnose_contacts(batch, contacts, pressing, diagnosis);
  });
  if (touches) diagnosis.unfinished_contacts = unfinished(batch);
  const double all = static_cast<double>(steps) * batch.environments();
  diagnosis.contacts_mean = static_cast<double>(pressing) / all;
  for (double* mean :
       {&diagnosis.near_mean, &diagnosis.points_mean, &diagnosis.rounds_mean, &diagnosis.tile_rounds_mean})
    *mean /= all;
  return diagnosis;
}

template Diagnosis diagnose(Batch<float>&, const Targets&, long);
template Diagnosis diagnose(Batch<double>&, const Targets&, long);

}  // namespace lockstep::tool
