// What users ask of a state: poses, velocities, Jacobians, energies, momentum. SPDX-License-Identifier: Apache-2.0
//
// Not part of a step; computed anew on request, by the same templates: (M49) to (M53).
#pragma once

#include "inverse_dynamics.h"
#include "kernels/contacts/readback.h"
#include "kernels/contacts/scan.h"
#include "kernels/couplings/coupling_error.h"
#include "kernels/dynamics/energies.h"
#include "load.h"

namespace lockstep::kernels {

enum class Quantity {
  coupling_errors,
  loop_errors,
  frame,
  frame_velocity,
  frame_position,
  frame_jacobian,
  kinetic_energy,
  potential_energy,
  momentum
};

/// A quantity, and for the frame_ ones which link and which frame on it.
template <class S>
struct Request {
  Quantity quantity;
  int link = 0;
  S offset[3] = {};  ///< frame's origin in the link
};

template <class T>
struct Output {
  ScalarOf<T>* rows;
  std::ptrdiff_t stride;
  LOCKSTEP_INLINE void put(int row, T value) const { store(rows + row * stride, value); }
  LOCKSTEP_INLINE void put(int row, const Vec3<T>& value) const {
    for (int k = 0; k < 3; ++k) put(row + k, value[k]);
  }
};

/// A point and an orientation on a link: in its body, or in the world if the link is bolted to it.
template <class T>
struct Place {
  Mat3<T> rotation;
  Vec3<T> position;
};

template <class T>
Place<T> place_of(const Tables<ScalarOf<T>>& t, const Motion<T>& m, const Request<ScalarOf<T>>& request) {
  const LinkPlace<ScalarOf<T>>& link = t.link[request.link];
  const Mat3<T> own = Mat3<T>::constant(link.rotation);
  const Vec3<T> in_body = multiply_add(own, Vec3<T>::constant(request.offset), Vec3<T>::constant(link.offset));
  const TreePlace<ScalarOf<T>>& tree = t.tree[link.tree];
  const Mat3<T> world = link.body < 0 ? Mat3<T>::constant(tree.rotation) : m.world[link.body];
  const Vec3<T> origin = link.body < 0 ? Vec3<T>::constant(tree.offset) : m.place[link.body];
  Place<T> place;
  place.position = multiply_add(world, in_body, origin);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      place.rotation(r, c) = fma(world(r, 0), own(0, c), fma(world(r, 1), own(1, c), world(r, 2) * own(2, c)));
  return place;
}

template <class T>
void put_velocity(const Tables<ScalarOf<T>>& t, const Motion<T>& m, const Request<ScalarOf<T>>& request,
                  const Output<T>& out) {
  const int b = t.link[request.link].body;
  Vec3<T> w = Vec3<T>::zero(), v = w;
  if (b >= 0) {
    const Vec3<T> arm = place_of(t, m, request).position - m.place[b];
    w = multiply(m.world[b], m.angular[b]);
    v = cross_add(w, arm, multiply(m.world[b], m.linear[b]));
  }
  out.put(0, w);
  out.put(3, v);
}

template <class T>
void put_jacobian(const Tables<ScalarOf<T>>& t, const Motion<T>& m, const Request<ScalarOf<T>>& request,
                  const Output<T>& out) {
  for (int row = 0; row < 6 * t.velocities; ++row) out.put(row, T(0));
  const Vec3<T> point = place_of(t, m, request).position;
  for (int b = t.link[request.link].body; b >= 0; b = t.body[b].parent) {
    const Body<ScalarOf<T>>& body = t.body[b];
    const Vec3<T> arm = point - m.place[b];
    const auto axis = [&](int k) { return Vec3<T>{m.world[b](0, k), m.world[b](1, k), m.world[b](2, k)}; };
    const auto turning = [&](int column, const Vec3<T>& e) {
      out.put(6 * column, e);
      out.put(6 * column + 3, cross(e, arm));
    };
    if (body.root) {
      const int first = 6 * body.joint;
      for (int k = 0; k < 3; ++k) {
        turning(first + k, axis(k));
        out.put(6 * (first + 3 + k) + 3, axis(k));
      }
      continue;
    }
    Vec3<T> e = axis(body.axis);
    for (int k = 0; k < 3; ++k) e[k] *= T(body.sign);
    const int column = 6 * t.roots.count + t.dof[body.joint];
    if (body.prismatic)
      out.put(6 * column + 3, e);
    else
      turning(column, e);
  }
}

template <class T>
void put_momentum(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Motion<T>& m, const Output<T>& out) {
  Vec3<T> total_linear = Vec3<T>::zero(), total_angular = total_linear;
  for (int b = 0; b < t.bodies; ++b) {
    Vec3<T> linear, angular;
    body_momentum(t, x, m, b, linear, angular);
    const Vec3<T> in_world = multiply(m.world[b], linear);
    total_linear = total_linear + in_world;
    total_angular = cross_add(m.place[b], in_world, multiply_add(m.world[b], angular, total_angular));
  }
  out.put(0, total_angular);
  out.put(3, total_linear);
}

template <class T>
void read(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
          std::ptrdiff_t last, const Request<ScalarOf<T>>& request, ScalarOf<T>* rows, std::ptrdiff_t stride,
          void* scratch) {
  Tile<T> x;
  Motion<T> m;
  lay_out(t, scratch, x, m);
  uniform_ratios(t, x);
  for (std::ptrdiff_t environment = first; environment < last; environment += T::lanes) {
    const StatePointers<ScalarOf<T>> own = at(t, batch, environment);
    const Output<T> out{rows + environment, stride};
    load(t, own, x);
    if (request.quantity == Quantity::coupling_errors) {
      coupling_errors(t, x);
      for (int c = 0; c < t.couplings; ++c) out.put(c, x.couplings.error[c]);
      continue;
    }
    motions(t, x, m);
    switch (request.quantity) {
      case Quantity::frame: {
        const Place<T> place = place_of(t, m, request);
        out.put(0, place.position);
        for (int k = 0; k < 9; ++k) out.put(3 + k, place.rotation(k / 3, k % 3));
        break;
      }
      case Quantity::frame_velocity: put_velocity(t, m, request, out); break;
      case Quantity::frame_position: out.put(0, place_of(t, m, request).position); break;
      case Quantity::frame_jacobian: put_jacobian(t, m, request, out); break;
      case Quantity::loop_errors:
        loop_gaps(t, own, m, x);
        for (int l = 0; l < t.loops.loops.count; ++l) {
          const auto length = [&](int first, int count) LOCKSTEP_INLINED {
            T squared = T(0);
            for (int r = first; r < first + count; ++r) squared = fma(x.loops.gap[r], x.loops.gap[r], squared);
            return sqrt(squared);
          };
          const HeldLoop<ScalarOf<T>>& loop = t.loops.loops[l];
          out.put(2 * l, length(loop.row, loop.translations));
          out.put(2 * l + 1, length(loop.row + loop.translations, loop.rotations));
        }
        break;
      case Quantity::kinetic_energy: out.put(0, kinetic_energy(t, own, x, m)); break;
      case Quantity::potential_energy: out.put(0, potential_energy(t, own, x, m)); break;
      default: put_momentum(t, x, m, out); break;
    }
  }
}

/// Numbers of one frame: position, rotation (row-major), angular and linear velocity, all in world axes.
constexpr int frame_numbers = 3 + 9 + 6;

/// Frames of the one tile that begins at environment `first`, in one pass over the bodies: `numbers` gets frame_numbers
/// rows of T::lanes for each request.
template <class T>
void read_frames(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
                 const Request<ScalarOf<T>>* requests, int count, ScalarOf<T>* numbers, void* scratch) {
  Tile<T> x;
  Motion<T> m;
  lay_out(t, scratch, x, m);
  uniform_ratios(t, x);
  load(t, at(t, batch, first), x);
  motions(t, x, m);
  for (int i = 0; i < count; ++i) {
    const Output<T> out{numbers + i * frame_numbers * T::lanes, T::lanes};
    const Place<T> place = place_of(t, m, requests[i]);
    out.put(0, place.position);
    for (int k = 0; k < 9; ++k) out.put(3 + k, place.rotation(k / 3, k % 3));
    put_velocity(t, m, requests[i], Output<T>{out.rows + 12 * T::lanes, T::lanes});
  }
}

/// The same of a plan that records accelerations: angular acceleration, acceleration of the origin minus gravity, force
/// and torque about the origin through the joint that carries the link, all in world axes.
constexpr int acceleration_numbers = 12;

template <class T>
void read_accelerations(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
                        const Request<ScalarOf<T>>* requests, int count, ScalarOf<T>* numbers, void* scratch) {
  Tile<T> x;
  Motion<T> m;
  const StatePointers<ScalarOf<T>> own = at(t, batch, first);
  InverseDynamics<T> found;
  Carver carver(scratch, lay_out(t, scratch, x, m));
  found.arrays(t, carver);
  uniform_ratios(t, x);
  load(t, own, x);
  motions(t, x, m);
  found.accelerate(t, m, x);
  found.find_wrenches(t, own, m, x);
  const Vec3<T> g = world_gravity<T>(t, own), none = Vec3<T>::zero();
  for (int i = 0; i < count; ++i) {
    const Output<T> out{numbers + i * acceleration_numbers * T::lanes, T::lanes};
    const int b = t.link[requests[i].link].body;
    Vec3<T> turning = none, moving = none, force = none, torque = none;
    if (b >= 0) {
      const Vec3<T> arm = place_of(t, m, requests[i]).position - m.place[b],
                    angular = multiply(m.world[b], m.angular[b]);
      turning = found.turning[b], force = found.force[b];
      moving = cross_add(turning, arm, cross_add(angular, cross(angular, arm), found.moving[b]));
      torque = found.moment[b] - cross(arm, force);
    }
    out.put(0, turning), out.put(3, moving - g), out.put(6, force), out.put(9, torque);
  }
}

/// Contacts of the one tile that begins at environment `first`: see contacts/readback.h.
template <class T>
void read_contacts(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, std::ptrdiff_t first,
                   ScalarOf<T>* numbers, void* scratch) {
  Tile<T> x;
  lay_out(t, scratch, x);
  uniform_ratios(t, x);
  load(t, at(t, batch, first), x);
  read_contacts(t, numbers, x);
}

}  // namespace lockstep::kernels
