// Thousands of random mechanisms with random bounds keep their promises. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "random_scenes.h"

namespace lockstep::stability {
namespace {

TEST(ThousandsOfRandomScenes, keep_their_promises) { search(601, 5400); }

}  // namespace
}  // namespace lockstep::stability
