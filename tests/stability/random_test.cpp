// Random mechanisms with random bounds keep their promises. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "random_scenes.h"

namespace lockstep::stability {
namespace {

TEST(RandomScenes, keep_their_promises) { search(1, 600); }

// The search must find errors: four sweeps leave couplings open by more than is promised.
TEST(RandomScenes, break_promises_with_few_sweeps) {
  int broken = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) broken += !broken_promise(random_scene(seed), Method::pgs).empty();
  EXPECT_GT(broken, 30);
}

// These seeds have found errors, or cases that the promises must exclude.
TEST(RandomScenes, keep_promises_that_were_broken_once) {
  search(48, 1);    // correcting a coupling moves joints beyond their limits, by the order of corrections in (M59)
  search(285, 1);   // restitution against a stiff servo
  search(532, 1);   // a limit against kinematic drives through couplings, whose corrections must leave no velocity
  search(5553, 1);  // the same, with unexplained energy
  for (int seed : {1547, 3430, 5159, 5392}) search(static_cast<std::uint64_t>(seed), 1);  // variants of the two above
  search(2556, 1);  // ratios of couplings in series multiply to 190: 300 rad/s at 1/245 s
  search(5962, 1);  // one of four couplings of three joints has another erp, so it decays at another rate
  for (int seed : {17, 41, 360, 369, 376, 709}) search(static_cast<std::uint64_t>(seed), 1);  // see known_test.cpp
}

}  // namespace
}  // namespace lockstep::stability
