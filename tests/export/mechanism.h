// What a Model means, whatever its frames and the order of its elements. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep {

/// What may differ, because the format does not have it.
struct Except {
  bool softness = false;   ///< of couplings
  bool colliders = false;  ///< and contacts
  bool sites = false;
};

/// Numbers under names: screws and inertias in the world where all joints are at 0, all else as it stands.
using Mechanism = std::map<std::string, std::vector<double>>;
Mechanism mechanism_of(const Model& model, const Except& except = {});

/// Every number within `tolerance` of the larger one or of 1.
void expect_same(const Mechanism& own, const Mechanism& wanted, double tolerance = 1e-12);

}  // namespace lockstep
