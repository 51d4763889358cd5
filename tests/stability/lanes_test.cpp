// Environments whose bounds act at other times do not see each other. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "contract.h"
#include "mechanisms.h"
#include "random_scenes.h"
#include "scenes/scenes.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

// chain8 with every kind of bound but a velocity limit (known_test.cpp); which of them act depends on where an
// environment is and where it is driven to.
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

// Nine environments fill a tile of eight and begin another.
TEST(StatePointers, environments_of_other_active_sets_give_the_bits_that_they_give_alone) {
  constexpr int environments = 9;
  for (Method method : physics::methods)
    in_both_precisions([&](auto scalar) {
      using S = decltype(scalar);
      SCOPED_TRACE(to_string(method));
      for (double dt : {1.0 / 60, 1.0 / 240}) {
        const Plan plan = compile(bounded(), recorded(dt, method));
        Batch<S> together = contract::scattered<S>(plan, environments, options());
        std::vector<Batch<S>> alone;
        for (int e = 0; e < environments; ++e) {
          alone.emplace_back(plan, 1, options());
          contract::scatter(alone.back(), 0, static_cast<std::uint64_t>(e));
        }
        std::vector<std::vector<S>> seen;  // which rows act, per environment
        for (int step = 0; step < 60; ++step) {
          together.step();
          for (int e = 0; e < environments; ++e) {
            alone[e].step();
            ASSERT_TRUE(contract::same_bits(together, e, alone[e], 0)) << "step " << step << " of " << e;
            ASSERT_TRUE((together.row_states().col(e) == alone[e].row_states().col(0)).all());
            ASSERT_TRUE((together.row_residuals().col(e) == alone[e].row_residuals().col(0)).all());
            ASSERT_EQ(together.conflicts(e), alone[e].conflicts(0));
          }
          if (step == 30)
            for (int e = 0; e < environments; ++e) {
              const auto states = together.row_states().col(e).eval();
              seen.emplace_back(states.data(), states.data() + states.size());
            }
        }
        std::sort(seen.begin(), seen.end());
        EXPECT_GE(std::unique(seen.begin(), seen.end()) - seen.begin(), 3) << "the sets differ";
      }
    });
}

// Random mechanisms whose bounds contradict each other: rows are looked for again and again, for a neighbour's sake as
// well, with and without compliance, and some searches find no end.
TEST(StatePointers, searches_that_neighbours_repeat_end_where_they_do_alone) {
  constexpr int environments = 9;
  for (const std::uint64_t seed : {41u, 360u, 532u, 1547u, 2556u, 3430u, 5159u, 5392u, 5553u, 9144u, 10120u})
    for (const Method method : {Method::automatic, Method::direct})
      in_both_precisions([&](auto scalar) {
        using S = decltype(scalar);
        SCOPED_TRACE(fmt::format("seed {} {}", seed, to_string(method)));
        const RandomScene scene = random_scene(seed);
        const Plan plan = compile(scene.model, recorded(scene.dt, method));
        Batch<S> together = contract::scattered<S>(plan, environments, options());
        std::vector<Batch<S>> alone;
        for (int e = 0; e < environments; ++e) {
          alone.emplace_back(plan, 1, options());
          contract::scatter(alone.back(), 0, static_cast<std::uint64_t>(e));
        }
        for (int step = 0; step < 60; ++step) {
          together.step();
          for (int e = 0; e < environments; ++e) {
            alone[e].step();
            ASSERT_TRUE(contract::same_bits(together, e, alone[e], 0)) << "step " << step << " of " << e;
          }
        }
      });
}

}  // namespace
}  // namespace lockstep::stability
