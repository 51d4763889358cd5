// Pieces of bounds as numbers, which a step remembers. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "kernels/contacts/pieces.h"

namespace lockstep::kernels {
namespace {

using One = simd::Wide<double, 1, simd::Unfused>;
using Piece = Branch<One>;

One::Mask mask(bool on) { return on ? ~One::none() : One::none(); }
Piece piece(bool low, bool high, bool stuck, double impulse) {
  return {mask(low), mask(high), mask(stuck), One(impulse)};
}

void expect_same(const Piece& a, const Piece& b) {
  EXPECT_EQ(lane(a.low, 0), lane(b.low, 0));
  EXPECT_EQ(lane(a.high, 0), lane(b.high, 0));
  EXPECT_EQ(lane(a.stuck, 0), lane(b.stuck, 0));
  EXPECT_EQ(a.impulse.lane(0), b.impulse.lane(0));
}

TEST(Pieces, come_back_from_their_numbers) {
  const double force = 0.25;
  for (const Piece& kept : {piece(true, false, false, 0), piece(false, true, false, 0), piece(false, false, true, 0),
                            piece(false, false, false, force), piece(false, false, false, -force)})
    expect_same(piece_of(number_of(kept), One(force)), kept);
}

TEST(Pieces, of_a_row_without_friction_that_is_free_have_no_impulse) {
  expect_same(piece_of(number_of(piece(false, false, false, 0)), One(0.0)), piece(false, false, false, 0));
}

TEST(Pieces, slip_with_the_friction_of_the_step_that_they_are_taken_to) {
  expect_same(piece_of(number_of(piece(false, false, false, -1.0)), One(0.5)), piece(false, false, false, -0.5));
}

TEST(Pieces, that_are_not_known_have_a_number_of_their_own) {
  for (const Piece& any : {piece(true, false, false, 0), piece(false, true, false, 0), piece(false, false, true, 0),
                           piece(false, false, false, 7)})
    EXPECT_LT(std::abs(number_of(any).lane(0)), unknown_piece - 0.5);
}

}  // namespace
}  // namespace lockstep::kernels
