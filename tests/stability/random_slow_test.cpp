// Several thousand random mechanisms with random bounds hold their couplings. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "random_scenes.h"

namespace lockstep::stability {
namespace {

TEST(RandomSlow, thousands_of_random_scenes_hold_their_couplings) { search(601, 5400); }

}  // namespace
}  // namespace lockstep::stability
