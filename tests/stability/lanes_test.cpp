// Environments with different active bounds do not change each other's bits. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "contract.h"
#include "mechanisms.h"
#include "random_scenes.h"
#include "scenes/scenes.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

// chain8 with every kind of bound but a velocity limit, which known_test.cpp has. The state and the targets of an
// environment decide which of them are active.
Model bounded() {
  Model model = scenes::chain8();
  model.joints[0].upper = 0.4;
  model.joints[2].lower = -0.3;
  model.joints[1].friction = 0.1;
  model.joints[4].drive = {1e3, 10.0, 0.5, 0.0};
  model.joints[4].effort_limit = 0.5;
  model.joints[5].drive.kinematic = true;
  model.joints[6].lower = -0.2, model.joints[6].upper = 0.5;
  model.joints[6].limit_softness = ErpCfm{0.2, 0.1};
  model.joints[7].restitution = 0.5, model.joints[7].upper = 0.45;
  model.couplings[0].force_limit = 0.3;
  return model;
}

// Nine environments fill a tile of eight lanes and begin another.
TEST(Lanes, with_different_active_sets_give_the_bits_of_single_environments) {
  constexpr int environments = 9;
  for (Method method : physics::methods)
    in_both_precisions([&](auto scalar) {
      using S = decltype(scalar);
      SCOPED_TRACE(to_string(method));
      for (double dt : {1.0 / 60, 1.0 / 240}) {
        const Plan plan = compile(bounded(), recorded(dt, method));
        Batch<S> crowd = contract::scattered<S>(plan, environments, options());
        std::vector<Batch<S>> single;
        for (int e = 0; e < environments; ++e) {
          single.emplace_back(plan, 1, options());
          contract::scatter(single.back(), 0, static_cast<std::uint64_t>(e));
        }
        std::vector<std::vector<S>> active_sets;  // states of rows, per environment
        for (int step = 0; step < 60; ++step) {
          crowd.step();
          for (int e = 0; e < environments; ++e) {
            single[e].step();
            ASSERT_TRUE(contract::same_bits(crowd, e, single[e], 0)) << "step " << step << " of " << e;
            ASSERT_TRUE((crowd.row_states().col(e) == single[e].row_states().col(0)).all());
            ASSERT_TRUE((crowd.row_residuals().col(e) == single[e].row_residuals().col(0)).all());
            ASSERT_EQ(crowd.conflicts(e), single[e].conflicts(0));
          }
          if (step == 30)
            for (int e = 0; e < environments; ++e) {
              const auto states = crowd.row_states().col(e).eval();
              active_sets.emplace_back(states.data(), states.data() + states.size());
            }
        }
        std::sort(active_sets.begin(), active_sets.end());
        EXPECT_GE(std::unique(active_sets.begin(), active_sets.end()) - active_sets.begin(), 3)
            << "the active sets do not differ";
      }
    });
}

// The bounds of these random mechanisms contradict each other. So the search for active rows is retried with and
// without compliance, also because of neighbours, and some searches run out of rounds.
TEST(Lanes, find_the_same_active_sets_if_neighbours_retry_the_search) {
  constexpr int environments = 9;
  for (const std::uint64_t seed : {41u, 360u, 532u, 1547u, 2556u, 3430u, 5159u, 5392u, 5553u, 9144u, 10120u})
    for (const Method method : {Method::automatic, Method::direct})
      in_both_precisions([&](auto scalar) {
        using S = decltype(scalar);
        SCOPED_TRACE(fmt::format("seed {} {}", seed, to_string(method)));
        const RandomScene scene = random_scene(seed);
        const Plan plan = compile(scene.model, recorded(scene.dt, method));
        Batch<S> crowd = contract::scattered<S>(plan, environments, options());
        std::vector<Batch<S>> single;
        for (int e = 0; e < environments; ++e) {
          single.emplace_back(plan, 1, options());
          contract::scatter(single.back(), 0, static_cast<std::uint64_t>(e));
        }
        for (int step = 0; step < 60; ++step) {
          crowd.step();
          for (int e = 0; e < environments; ++e) {
            single[e].step();
            ASSERT_TRUE(contract::same_bits(crowd, e, single[e], 0)) << "step " << step << " of " << e;
          }
        }
      });
}

}  // namespace
}  // namespace lockstep::stability
