// What tests of ranks step: differing actions, parameters and resets, by the ids of the environments alone.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "contacts/heaps.h"
#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "lockstep/ranks.h"
#include "scenes/scenes.h"

namespace lockstep::ranked {

/// A gripper with parameters that differ, a chain of mimics under a leapfrog, and things that fall on each other.
inline std::vector<Plan> plans() {
  Model gripper = scenes::gripper13();
  for (Joint& joint : gripper.joints) joint.drive.kp = 4.0, joint.drive.kd = 0.2;
  Model heap = contact_scenes::heap(3);
  return {compile(gripper, {.per_environment = {Parameter::mass, Parameter::damping}}),
          compile(scenes::chain8(), {.integrator = Integrator::leapfrog}), compile(heap)};
}

template <class S>
Batch<S> batch_of(const Plan& plan, const IdRange& ids, int threads = 1) {
  Batch<S> batch(plan, ids.count, {.threads = threads, .seed = 9, .first_id = ids.first});
  for (const Parameter parameter : {Parameter::mass, Parameter::damping})
    if (plan.settings().per_environment.contains(parameter)) batch.randomize(parameter, {.low = 0.8, .high = 1.2});
  batch.reset_random(EnvironmentSet::all(), {.spread = 0.2, .speed = 0.1});
  return batch;
}

/// A control period: new efforts and targets, a few steps, and a reset of whose turn it is.
template <class S>
void control(Batch<S>& batch, unsigned update) {
  const auto draw = [&](typename Batch<S>::View rows) {
    if (rows.rows() == 0) return;
    batch.draw({rows.data(), rows.outerStride()}, static_cast<int>(rows.rows()), update);
    rows = S(0.4) * (rows - S(0.5));
  };
  draw(batch.position_targets()), draw(batch.efforts());
  batch.step(4);
  std::vector<int> over;
  for (int e = 0; e < batch.environments(); ++e)
    if ((batch.ids()[e] + update) % 7 == 0) over.push_back(e);
  batch.reset_random(over, {.spread = 0.2, .speed = 0.1});
}

template <class S>
std::vector<Batch<S>> batches_of(const Plan& plan, int environments, int ranks, std::uint32_t first) {
  std::vector<Batch<S>> batches;
  for (int rank = 0; rank < ranks; ++rank)
    batches.push_back(batch_of<S>(plan, ids_of({rank, ranks}, environments, first), 1 + rank % 2));
  return batches;
}

/// The saves of all batches as the one of a batch that has all of their environments.
template <class S>
std::vector<std::byte> joined(const Plan& plan, const std::vector<Batch<S>>& batches) {
  int environments = 0;
  for (const Batch<S>& batch : batches) environments += batch.environments();
  Batch<S> all(plan, environments, {.threads = 1});
  int first = 0;
  for (const Batch<S>& batch : batches) {
    std::vector<int> into(static_cast<std::size_t>(batch.environments()));
    for (int& place : into) place = first++;
    all.restore(batch.save(), into);
  }
  return all.save();
}

}  // namespace lockstep::ranked
