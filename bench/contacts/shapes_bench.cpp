// What pairs of shapes cost, as ratios to two boxes in the same run. SPDX-License-Identifier: Apache-2.0
//
//   shapes_bench
//
// f32 on AVX2, one thread, 8 environments whose poses differ, shapes 20 um in each other. At rest poses repeat, so the
// memory fits; in motion the second shape turns by 0.01 rad a step. Least of 15 interleaved repeats. It prints a table.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "contacts/solids.h"
#include "cpu_seconds.h"
#include "kernels/contacts/broad_phase.h"
#include "kernels/contacts/half_space_cylinder.h"
#include "kernels/contacts/half_space_ellipsoid.h"
#include "kernels/contacts/half_space_hull.h"
#include "kernels/contacts/height_field.h"

namespace lockstep::contacts_test {
namespace {

using T = simd::Wide<float, 8, simd::Fused>;
using Placed = kernels::PlacedShape<T>;

constexpr int steps = 64, rounds = 8, repeats = 15;
constexpr float margin = 0.005f, slack = 1e-5f;

enum class Motion { rests, turns };
enum class Lie { faces, any };

// Of a solid's frame, along the normal of a face.
Vector3d face_of(const Solid& solid) {
  return solid.kind == ShapeKind::hull ? hull_of(solid.corners).faces[0].normal : Vector3d::UnitZ();
}

struct Poses {
  std::vector<Placed> first, second;

  Poses(const Solid& a, const Solid& b, Lie lie, Motion motion) : first(steps), second(steps) {
    Random random(3);
    for (int lane = 0; lane < T::lanes; ++lane) {
      const Vector3d normal = lie == Lie::faces ? face_of(a) : random.direction();
      Matrix3d turn = random.rotation();
      if (lie == Lie::faces) turn = Eigen::Quaterniond::FromTwoVectors(face_of(b), -normal).toRotationMatrix();
      const Matrix3d turning = Eigen::AngleAxisd(0.01, random.direction()).toRotationMatrix();
      for (int step = 0; step < steps; ++step) {
        Shape one, other;
        one.size = a.kind == ShapeKind::hull ? Vector3d::Zero() : a.size;
        other.size = b.kind == ShapeKind::hull ? Vector3d::Zero() : b.size;
        other.rotation = turn;
        other.center = a.support(normal) + (a.radius() + b.radius() - 2e-5) * normal -
                       turn * b.support(-(turn.transpose() * normal));
        put(one, lane, first[static_cast<std::size_t>(step)]);
        put(other, lane, second[static_cast<std::size_t>(step)]);
        if (motion == Motion::turns) turn = turning * turn;
      }
    }
  }
};

struct Case {
  std::string name;
  std::function<void(std::size_t)> touch;
  double best = 1e9;
};

volatile float sink;

void keep(const kernels::Patch<T>& patch) {
  float sum = 0.0f;
  for (int lane = 0; lane < T::lanes; ++lane) sum += patch.gap[0].lane(lane) + patch.point[1].x.lane(lane);
  sink = sum;
}

TouchingPair<float> numbers_of_pair() {
  TouchingPair<float> numbers{};
  numbers.apart = 1e-3f, numbers.size = 0.17f, numbers.slack = slack;
  return numbers;
}

Case boxes(const Solid& box, Motion motion) {
  const auto poses = std::make_shared<Poses>(box, box, Lie::faces, motion);
  return {motion == Motion::rests ? "two boxes, at rest" : "two boxes, in motion", [poses](std::size_t step) {
            kernels::Patch<T> patch;
            kernels::box_box(poses->first[step], poses->second[step], numbers_of_pair(), ~T::none(), T(margin), patch);
            keep(patch);
          }};
}

Case convex(const std::string& name, const Solid& a, const Solid& b, Lie lie, Motion motion) {
  struct Pair {
    Poses poses;
    CoreOf<T> first, second;
    kernels::ConvexMemory<T> memory{simd::Vec3<T>::zero(), simd::Vec3<T>::zero()};
    bool kept = false;

    Pair(const Solid& a, const Solid& b, Lie lie, Motion motion) : poses(a, b, lie, motion), first(a), second(b) {}
  };
  const auto pair = std::make_shared<Pair>(a, b, lie, motion);
  return {name, [pair, motion](std::size_t step) {
            if (step == 0 && motion == Motion::turns) pair->kept = false;  // the poses begin again
            kernels::Patch<T> patch;
            kernels::touch_convex(pair->first.core, pair->second.core, pair->poses.first[step],
                                  pair->poses.second[step], numbers_of_pair(), T(margin), ~T::none(),
                                  pair->kept ? ~T::none() : T::none(), pair->memory, patch);
            pair->kept = true;
            keep(patch);
          }};
}

Case on_half_space(const std::string& name, const Solid& solid) {
  const auto poses = std::make_shared<Poses>(solid, solid, Lie::any, Motion::turns);
  const auto core = std::make_shared<CoreOf<T>>(solid);
  return {name, [poses, core](std::size_t step) {
            const Placed &plane = poses->first[step], &placed = poses->second[step];
            kernels::Patch<T> patch;
            for (T& gap : patch.gap) gap = T(0);
            for (auto& point : patch.point) point = simd::Vec3<T>::zero();
            switch (core->core.kind) {
              case ShapeKind::cylinder: kernels::half_space_cylinder(plane, placed, T(margin), patch); break;
              case ShapeKind::ellipsoid: kernels::half_space_ellipsoid(plane, placed, T(margin), patch); break;
              default: kernels::half_space_hull(plane, core->core, placed, T(slack), patch);
            }
            keep(patch);
          }};
}

// All points of the solid, on 41 x 41 heights within 2 cm that are 5 cm apart.
Case on_field(const std::string& name, const Solid& solid) {
  struct Ground {
    Poses poses;
    CoreOf<T> core;
    std::vector<float> heights = std::vector<float>(41 * 41);

    explicit Ground(const Solid& solid) : poses(solid, solid, Lie::any, Motion::turns), core(solid) {
      Random random(4);
      for (float& height : heights) height = static_cast<float>(random.between(-0.01, 0.01));
    }
  };
  const auto ground = std::make_shared<Ground>(solid);
  const bool is_round = solid.kind == ShapeKind::sphere;
  return {name, [ground, is_round](std::size_t step) {
            const HeightTable<float> field{41, 41, ground->heights.data(), ground->heights.data()};
            Placed placed = ground->poses.first[step];
            placed.size[0] = placed.size[1] = T(20.0f);
            Placed seen = ground->poses.second[step];
            seen.center = {T(0.1f), T(0.07f), T(0.05f)};
            kernels::GroundPoints<T> points;
            kernels::find_ground_points(field, placed, ground->core.core, seen, T(0.08f), T(slack), points);
            kernels::Patch<T> patch;
            patch.point[1] = simd::Vec3<T>::zero();
            for (int point = 0; point < (is_round ? 2 : 4); ++point) {
              kernels::touch_height_field(field, placed, ground->core.core, point, points, patch);
              keep(patch);
            }
          }};
}

// 21 balls of 2 cm on a line, 200 of their pairs; none meets another one.
Case spheres_of_200_pairs() {
  const auto balls = std::make_shared<std::vector<kernels::MovingCollider<T>>>(21);
  for (std::size_t i = 0; i < balls->size(); ++i) {
    kernels::MovingCollider<T>& ball = (*balls)[i];
    ball.shape.center = {T(0.1f * static_cast<float>(i)), T(0), T(0)};
    ball.stretch = T(1.02f), ball.span = T(0.03f), ball.other_span = T(0.025f);
  }
  return {"spheres about 200 pairs, all apart", [balls](std::size_t) {
            int met = 0, pairs = 0;
            for (std::size_t i = 0; i < balls->size(); ++i)
              for (std::size_t j = i + 1; j < balls->size() && pairs < 200; ++j, ++pairs)
                met += any(kernels::spheres_meet(ShapeKind::box, (*balls)[i], (*balls)[j]));
            sink = static_cast<float>(met);
          }};
}

Case boxes_about(const Solid& box) {
  const auto poses = std::make_shared<Poses>(box, box, Lie::any, Motion::turns);
  const auto pair = std::make_shared<std::array<kernels::MovingCollider<T>, 2>>();
  for (kernels::MovingCollider<T>& own : *pair) {
    for (int k = 0; k < 3; ++k) own.half[k] = T(static_cast<float>(box.size[k]));
    own.reach = T(static_cast<float>(box.size.norm()));
  }
  return {"boxes about a pair", [poses, pair](std::size_t step) {
            (*pair)[0].shape = poses->first[step], (*pair)[1].shape = poses->second[step];
            sink = any(kernels::boxes_meet((*pair)[0], (*pair)[1], T(margin))) ? 1.0f : 0.0f;
          }};
}

// Of a ball of 5 cm.
Solid hull_with(int corners, Random& random) {
  Solid solid{ShapeKind::hull, {0.05, 0.05, 0.05}, Eigen::Matrix3Xd(3, corners)};
  for (int i = 0; i < corners; ++i) solid.corners.col(i) = 0.05 * random.direction();
  return solid;
}

std::vector<Case> cases() {
  Random random(5);
  const Solid box = cuboid({0.05, 0.05, 0.05}, ShapeKind::box), cylinder{ShapeKind::cylinder, {0.04, 0.05, 0.0}},
              ellipsoid{ShapeKind::ellipsoid, {0.03, 0.04, 0.05}}, capsule{ShapeKind::capsule, {0.02, 0.05, 0.0}},
              sphere{ShapeKind::sphere, {0.03, 0.0, 0.0}};
  const Solid hull12 = hull_with(12, random), hull32 = hull_with(32, random), hull64 = hull_with(64, random);
  std::vector<Case> all{boxes(box, Motion::rests), boxes(box, Motion::turns)};
  for (const Motion motion : {Motion::rests, Motion::turns}) {
    const std::string how = motion == Motion::rests ? ", at rest" : ", in motion";
    all.push_back(convex("two hulls of 12 corners on a face" + how, hull12, hull12, Lie::faces, motion));
    all.push_back(convex("two hulls of 32 corners on a face" + how, hull32, hull32, Lie::faces, motion));
    all.push_back(convex("two hulls of 64 corners on a face" + how, hull64, hull64, Lie::faces, motion));
    all.push_back(convex("box and hull of 32 on a face" + how, box, hull32, Lie::faces, motion));
    all.push_back(convex("box and cylinder on a face" + how, box, cylinder, Lie::faces, motion));
    all.push_back(convex("box and cylinder, any way" + how, box, cylinder, Lie::any, motion));
    all.push_back(convex("two cylinders, any way" + how, cylinder, cylinder, Lie::any, motion));
    all.push_back(convex("hull of 32 and capsule, any way" + how, hull32, capsule, Lie::any, motion));
    all.push_back(convex("hull of 32 and sphere" + how, hull32, sphere, Lie::any, motion));
    all.push_back(convex("box and ellipsoid" + how, box, ellipsoid, Lie::any, motion));
    all.push_back(convex("two ellipsoids" + how, ellipsoid, ellipsoid, Lie::any, motion));
  }
  all.push_back(on_field("height field and sphere", {ShapeKind::sphere, {0.05, 0, 0}}));
  all.push_back(on_field("height field and box", box));
  all.push_back(spheres_of_200_pairs());
  all.push_back(boxes_about(box));
  all.push_back(on_half_space("half-space and cylinder", cylinder));
  all.push_back(on_half_space("half-space and ellipsoid", ellipsoid));
  all.push_back(on_half_space("half-space and hull of 32", hull32));
  all.push_back(on_half_space("half-space and hull of 64", hull64));
  return all;
}

void print() {
  std::vector<Case> all = cases();
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (Case& one : all) {
      const double start = bench::cpu_seconds();
      for (int round = 0; round < rounds; ++round)
        for (std::size_t step = 0; step < steps; ++step) one.touch(step);
      one.best = std::min(one.best, (bench::cpu_seconds() - start) * 1e9 / (rounds * steps * T::lanes));
    }
    std::fprintf(stderr, "\rrepeat %d of %d", repeat + 1, repeats);
  }
  std::fprintf(stderr, "\n");
  std::printf("| pair | ns | of two boxes at rest |\n| --- | --- | --- |\n");
  for (const Case& one : all) std::printf("| %s | %.1f | %.2f |\n", one.name.c_str(), one.best, one.best / all[0].best);
}

}  // namespace
}  // namespace lockstep::contacts_test

int main() { lockstep::contacts_test::print(); }
