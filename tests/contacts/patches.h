// Shapes and patches in plain numbers, for tests of the pairs of shapes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <vector>

#include "kernels/contacts/box_box.h"
#include "kernels/contacts/box_capsule.h"
#include "kernels/contacts/box_sphere.h"
#include "kernels/contacts/capsule_capsule.h"
#include "kernels/contacts/capsule_sphere.h"
#include "kernels/contacts/half_space_box.h"
#include "kernels/contacts/half_space_capsule.h"
#include "kernels/contacts/half_space_sphere.h"
#include "kernels/contacts/sphere_sphere.h"
#include "plan/tables/contacts.h"

namespace lockstep::contacts_test {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Widths that no target of the library has for another instruction set. The linker could take one for the other.
using f64 = simd::Wide<double, 1, simd::Fused>;
using f32 = simd::Wide<float, 1, simd::Fused>;
using f32x4 = simd::Wide<float, 4, simd::Fused>;

enum class Form { half_space, box, capsule, sphere };

/// A shape in the world. Its size is that of kernels::PlacedShape.
struct Shape {
  Form form = Form::sphere;
  Vector3d size = Vector3d::Ones();
  Vector3d center = Vector3d::Zero();
  Matrix3d rotation = Matrix3d::Identity();

  Vector3d axis(int k) const { return rotation.col(k); }
  Vector3d local(const Vector3d& p) const { return rotation.transpose() * (p - center); }
  Vector3d world(const Vector3d& p) const { return rotation * p + center; }
  /// The distance from what is inside to the surface.
  double radius() const { return form == Form::sphere || form == Form::capsule ? size.x() : 0.0; }
  Shape at(const Vector3d& place) const { return {form, size, place, rotation}; }
  Shape turned(const Matrix3d& to) const { return {form, size, center, to}; }
  /// Moved and turned as a part of a rigid body.
  Shape moved(const Matrix3d& turn, const Vector3d& way) const {
    return {form, size, turn * center + way, turn * rotation};
  }
};
inline Shape half_space() { return {Form::half_space, Vector3d::Zero()}; }
inline Shape box(const Vector3d& half_edges) { return {Form::box, half_edges}; }
inline Shape capsule(double radius, double half_length) { return {Form::capsule, {radius, half_length, 0.0}}; }
inline Shape sphere(double radius) { return {Form::sphere, {radius, 0.0, 0.0}}; }

struct Slot {
  Vector3d point;
  double gap;
  int face;
  bool valid;
};
/// Of two boxes: whether edges touch. Numbers of faces are below 12 or, where the deepest point took a slot, from 100.
inline bool is_of_edges(const Slot& slot) { return slot.face % 100 >= 12; }

struct Touch {
  Vector3d normal, tangent, other_tangent;
  std::vector<Slot> slots;

  /// The smallest gap; infinite where no slot is valid.
  double gap() const {
    double least = INFINITY;
    for (const Slot& slot : slots)
      if (slot.valid) least = std::min(least, slot.gap);
    return least;
  }
  std::vector<Slot> valid() const {
    std::vector<Slot> found;
    std::copy_if(slots.begin(), slots.end(), std::back_inserter(found), [](const Slot& slot) { return slot.valid; });
    return found;
  }
};

/// Those that have a form of their own.
constexpr std::array all_kinds = {PairKind::half_space_box,  PairKind::half_space_capsule, PairKind::half_space_sphere,
                                  PairKind::box_box,         PairKind::box_capsule,        PairKind::box_sphere,
                                  PairKind::capsule_capsule, PairKind::capsule_sphere,     PairKind::sphere_sphere};

struct Forms {
  Form first, second;
};
inline Forms forms_of(PairKind kind) {
  switch (kind) {
    case PairKind::half_space_box: return {Form::half_space, Form::box};
    case PairKind::half_space_capsule: return {Form::half_space, Form::capsule};
    case PairKind::half_space_sphere: return {Form::half_space, Form::sphere};
    case PairKind::box_box: return {Form::box, Form::box};
    case PairKind::box_capsule: return {Form::box, Form::capsule};
    case PairKind::box_sphere: return {Form::box, Form::sphere};
    case PairKind::capsule_capsule: return {Form::capsule, Form::capsule};
    case PairKind::capsule_sphere: return {Form::capsule, Form::sphere};
    default: return {Form::sphere, Form::sphere};
  }
}
inline PairKind kind_of(const Shape& first, const Shape& second) {
  return *std::find_if(all_kinds.begin(), all_kinds.end(), [&](PairKind kind) {
    return forms_of(kind).first == first.form && forms_of(kind).second == second.form;
  });
}

template <class T>
void touch_wide(PairKind kind, const kernels::PlacedShape<T>& a, const kernels::PlacedShape<T>& b, T margin,
                kernels::Patch<T>& patch) {
  switch (kind) {
    case PairKind::half_space_box: return kernels::half_space_box(a, b, margin, patch);
    case PairKind::half_space_capsule: return kernels::half_space_capsule(a, b, margin, patch);
    case PairKind::half_space_sphere: return kernels::half_space_sphere(a, b, margin, patch);
    case PairKind::box_box: {
      TouchingPair<simd::ScalarOf<T>> numbers{};
      numbers.apart = simd::ScalarOf<T>(1e-4), numbers.size = simd::ScalarOf<T>(1);
      return kernels::box_box(a, b, numbers, ~T::none(), margin, patch);
    }
    case PairKind::box_capsule: return kernels::box_capsule(a, b, margin, patch);
    case PairKind::box_sphere: return kernels::box_sphere(a, b, margin, patch);
    case PairKind::capsule_capsule: return kernels::capsule_capsule(a, b, margin, patch);
    case PairKind::capsule_sphere: return kernels::capsule_sphere(a, b, margin, patch);
    case PairKind::sphere_sphere: return kernels::sphere_sphere(a, b, margin, patch);
    default: throw std::logic_error("solids.h has the pairs that are convex");
  }
}

template <class T>
void put(const Shape& shape, int lane, kernels::PlacedShape<T>& wide) {
  using S = simd::ScalarOf<T>;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) wide.rotation(r, c).set_lane(lane, static_cast<S>(shape.rotation(r, c)));
    wide.center[r].set_lane(lane, static_cast<S>(shape.center[r]));
    wide.size[r].set_lane(lane, static_cast<S>(shape.size[r]));
  }
}

template <class T>
Touch get(const kernels::Patch<T>& patch, int slots, int lane) {
  const auto vector = [lane](const simd::Vec3<T>& v) {
    return Vector3d(v.x.lane(lane), v.y.lane(lane), v.z.lane(lane));
  };
  Touch touch{vector(patch.normal), vector(patch.tangent), vector(patch.other_tangent), {}};
  for (int s = 0; s < slots; ++s)
    touch.slots.push_back({vector(patch.point[s]), static_cast<double>(patch.gap[s].lane(lane)),
                           static_cast<int>(std::lround(patch.face[s].lane(lane))), patch.valid[s].lane(lane)});
  return touch;
}

constexpr double usual_margin = 0.005;

/// Where two shapes touch, as the kernels find it.
template <class T = f64>
Touch touch(const Shape& first, const Shape& second, double margin = usual_margin) {
  kernels::PlacedShape<T> a, b;
  put(first, 0, a), put(second, 0, b);
  kernels::Patch<T> patch;
  const PairKind kind = kind_of(first, second);
  touch_wide(kind, a, b, T(static_cast<simd::ScalarOf<T>>(margin)), patch);
  return get(patch, slots_of(kind), 0);
}

/// Random numbers that are the same everywhere, unlike those of the standard distributions. Draw one in an expression:
/// compilers differ in which operand comes first.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  int below(int count) { return static_cast<int>(engine_() % static_cast<unsigned>(count)); }
  Vector3d within(double low, double high) {
    const double x = between(low, high), y = between(low, high);
    return {x, y, between(low, high)};
  }
  Vector3d direction() {
    for (;;) {
      const Vector3d d = within(-1.0, 1.0);
      if (d.norm() > 0.1 && d.norm() < 1.0) return d.normalized();
    }
  }
  Matrix3d rotation(double most = M_PI) {
    const Vector3d axis = direction();
    return Eigen::AngleAxisd(between(-most, most), axis).toRotationMatrix();
  }
  Shape shape(Form form) {
    if (form == Form::half_space) return half_space();
    if (form == Form::box) return box(within(0.01, 0.1));
    const double radius = between(0.01, 0.05);
    return form == Form::sphere ? sphere(radius) : capsule(radius, between(0.02, 0.2));
  }

 private:
  std::mt19937_64 engine_;
};

struct Scene {
  Shape first, second;
};

/// Shapes about a metre from the origin, apart or overlapping by a few millimetres. What the kernels say decides how
/// the second is placed, so nothing follows from it about what they say then.
inline Scene touching_lightly(PairKind kind, Random& random) {
  Scene scene{random.shape(forms_of(kind).first), random.shape(forms_of(kind).second)};
  scene.first.rotation = random.rotation(), scene.second.rotation = random.rotation();
  scene.first.center = random.within(-1.0, 1.0);
  Vector3d away = random.direction();
  if (kind_of(scene.first, scene.second) <= PairKind::half_space_sphere && away.dot(scene.first.axis(2)) < 0.0)
    away = -away;
  scene.second.center = scene.first.center + 0.6 * away;
  const double gap = random.between(-0.003, 0.002);
  for (int round = 0; round < 200; ++round) {  // towards the first, by less than the gap
    const Touch now = touch(scene.first, scene.second, 10.0);
    const double step = std::isfinite(now.gap()) ? std::max(0.9 * (now.gap() - gap), 1e-9) : 0.001;
    if (now.gap() - gap < 1e-9) break;
    scene.second.center -= step * away;
  }
  return scene;
}

inline Matrix3d about_z(double angle) { return Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix(); }

}  // namespace lockstep::contacts_test
