// Which points of two faces become the slots of a pair. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// For each diagonal of a face the candidate that is farthest along it, and the deepest one. Equal points count once.
/// Rounding must not choose. So the diagonals lean a little, or squares at 45 degrees would have two corners equally
/// far; and of candidates that are about as deep, as on faces that lie on each other, the first one counts.
///
/// Points that are nearer to each other than `same` are equal; another point must be deeper by `deeper_by`.
template <class T, class Points>
void choose_slots(const Points& all, int count, T same, T deeper_by, T (&x)[4], T (&y)[4], T (&z)[4],
                  typename T::Mask (&valid)[4], typename T::Mask (&replaced)[4]) {
  using S = ScalarOf<T>;
  // The deepest candidate.
  T deepest = T(S(1e30)), to_beat = deepest, deep_x = T(0), deep_y = T(0);
  for (int c = 0; c < count; ++c) {
    const auto deeper = all.valid[c] & less(all.z[c], to_beat);
    to_beat = select(deeper, all.z[c] - deeper_by, to_beat);
    deepest = select(deeper, all.z[c], deepest);
    deep_x = select(deeper, all.x[c], deep_x), deep_y = select(deeper, all.y[c], deep_y);
  }

  // The farthest along each diagonal. What an earlier slot has already is left out.
  for (int slot = 0; slot < 4; ++slot) {
    const T right = T(S(slot % 2 == 0 ? -1 : 1)), up = T(S(slot < 2 ? -1.02 : 1.02));
    T best = T(S(-1e30));
    x[slot] = y[slot] = z[slot] = T(0);
    valid[slot] = replaced[slot] = T::none();
    for (int c = 0; c < count; ++c) {
      const T along = fma(right, all.x[c], up * all.y[c]);
      const auto farther_along = all.valid[c] & less(best, along);
      best = select(farther_along, along, best);
      x[slot] = select(farther_along, all.x[c], x[slot]);
      y[slot] = select(farther_along, all.y[c], y[slot]);
      z[slot] = select(farther_along, all.z[c], z[slot]);
      valid[slot] = valid[slot] | farther_along;
    }
    for (int earlier = 0; earlier < slot; ++earlier) {
      const auto equal = less(absolute(x[slot] - x[earlier]) + absolute(y[slot] - y[earlier]), same);
      valid[slot] = valid[slot] & ~(equal & valid[earlier]);
    }
  }

  // The deepest candidate takes the place of the shallowest slot, or of an empty one.
  typename T::Mask missing = less(deepest, T(S(1e29)));
  T shallowest = T(S(-1e30));
  for (int slot = 0; slot < 4; ++slot) {
    missing = missing & ~(valid[slot] & less(absolute(x[slot] - deep_x) + absolute(y[slot] - deep_y), same));
    shallowest = larger(shallowest, select(valid[slot], z[slot], T(S(1e29))));
  }
  typename T::Mask open = missing & less(deeper_by, shallowest - deepest);
  for (int slot = 0; slot < 4; ++slot) {
    const auto here = open & ~less(select(valid[slot], z[slot], T(S(1e29))), shallowest);
    x[slot] = select(here, deep_x, x[slot]), y[slot] = select(here, deep_y, y[slot]);
    z[slot] = select(here, deepest, z[slot]);
    valid[slot] = valid[slot] | here, replaced[slot] = here;
    open = open & ~here;
  }
}

}  // namespace lockstep::kernels
