// Balls and points against the triangles of a height field. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "kernels/contacts/height_field.h"
#include "patches.h"

namespace lockstep::contacts_test {
namespace {

// Heights on a grid of cells of 10 x 8 cm, and the tables of the kernels.
struct Terrain {
  static constexpr int columns = 9, rows = 7;
  static constexpr double width = 0.1, depth = 0.08;
  std::vector<double> heights = std::vector<double>(columns * rows);

  Terrain(double height, Random& random) {
    for (double& number : heights) number = height * random.between(-1.0, 1.0);
  }
  HeightTable<double> table() const { return {columns, rows, heights.data(), heights.data()}; }
  kernels::PlacedShape<f64> placed() const {
    kernels::PlacedShape<f64> shape;
    shape.size[0] = f64(1.0 / width), shape.size[1] = f64(1.0 / depth), shape.size[2] = f64(1.0);
    return shape;
  }
  Vector3d corner(int column, int row) const {
    return {(column - 0.5 * (columns - 1)) * width, (row - 0.5 * (rows - 1)) * depth, heights[row * columns + column]};
  }
  /// act(three corners, cell) for all triangles.
  template <class Act>
  void each_triangle(Act&& act) const {
    for (int j = 0; j + 1 < rows; ++j)
      for (int i = 0; i + 1 < columns; ++i) {
        act(corner(i, j), corner(i + 1, j), corner(i + 1, j + 1));
        act(corner(i, j), corner(i + 1, j + 1), corner(i, j + 1));
      }
  }
};

// Of a triangle to a point, by the parts that can be nearest.
double distance(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d n = (b - a).cross(c - a).normalized();
  const auto side = [&](const Vector3d& from, const Vector3d& to) { return n.dot((to - from).cross(p - from)); };
  if (side(a, b) >= 0 && side(b, c) >= 0 && side(c, a) >= 0) return std::abs(n.dot(p - a));
  const auto to_edge = [&](const Vector3d& from, const Vector3d& to) {
    const double share = std::clamp((p - from).dot(to - from) / (to - from).squaredNorm(), 0.0, 1.0);
    return (p - from - share * (to - from)).norm();
  };
  return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
}

kernels::Vec3<f64> wide(const Vector3d& v) { return {f64(v.x()), f64(v.y()), f64(v.z())}; }
Vector3d plain(const kernels::Vec3<f64>& v) { return {v.x.lane(0), v.y.lane(0), v.z.lane(0)}; }

TEST(Facets, the_triangle_below_a_point_is_that_of_its_cell) {
  Random random(1);
  const Terrain terrain(0.05, random);
  for (int i = 0; i < 20000; ++i) {
    const Vector3d p(random.between(-0.39, 0.39), random.between(-0.23, 0.23), 0.2);
    const kernels::Facet<f64> facet = kernels::facet_below(terrain.table(), terrain.placed(), wide(p));
    double expected = -1.0;
    Vector3d normal = Vector3d::Zero();
    terrain.each_triangle([&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
      const auto side = [&](const Vector3d& from, const Vector3d& to) {
        return (to - from).head<2>().x() * (p - from).y() - (to - from).y() * (p - from).x();
      };
      if (side(a, b) < 0 || side(b, c) < 0 || side(c, a) < 0) return;
      normal = (b - a).cross(c - a).normalized();
      expected = a.z() - (normal.x() * (p - a).x() + normal.y() * (p - a).y()) / normal.z();
    });
    ASSERT_NEAR(facet.height.lane(0), expected, 1e-12);
    ASSERT_LT((plain(facet.normal) - normal).norm(), 1e-12);
    ASSERT_TRUE(any(facet.inside));
  }
}

TEST(Facets, beyond_the_edges_there_is_nothing) {
  Random random(2);
  const Terrain terrain(0.05, random);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vector3d& p : {Vector3d(0.401, 0, 0), Vector3d(-0.401, 0, 0), Vector3d(0, 0.241, 0),
                            Vector3d(1e30, -1e30, 0), Vector3d(nan, 0, 0)}) {
    const kernels::Facet<f64> facet = kernels::facet_below(terrain.table(), terrain.placed(), wide(p));
    EXPECT_TRUE(!any(facet.inside) || std::isnan(p.x()));
  }
}

// The two slots of a ball rarely miss the nearest triangle, on slopes of 45 degrees at random: by its radius, the share
// of balls whose gap is off by more than a ten-thousandth of it, and by more than a tenth.
TEST(Facets, a_ball_no_larger_than_a_cell_finds_the_nearest_triangle) {
  for (const auto& [ball, most_off, most_far_off] :
       {std::tuple(0.02, 0.01, 0.001), std::tuple(0.05, 0.02, 0.002), std::tuple(0.08, 0.04, 0.002)}) {
    const double radius = ball;
    Random random(3);
    int near = 0, off = 0, far_off = 0;
    for (int i = 0; i < 20000; ++i) {
      const Terrain terrain(0.06, random);
      const Vector3d p(random.between(-0.29, 0.29), random.between(-0.15, 0.15), random.between(-0.05, 0.12));
      const kernels::Facet<f64> facet = kernels::facet_below(terrain.table(), terrain.placed(), wide(p));
      double truth = 1.0;
      terrain.each_triangle([&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
        truth = std::min(truth, distance(p, a, b, c) - radius);
      });
      if (p.z() < facet.height.lane(0) || truth > 0.002) continue;
      ++near;
      const auto below = kernels::gap_toward(terrain.table(), terrain.placed(), wide(p), wide(p), f64(radius));
      const auto beside = kernels::gap_beside(terrain.table(), terrain.placed(), wide(p), f64(radius), below);
      const double found =
          std::min(below.gap.lane(0), any(beside.valid) ? beside.gap.lane(0) : std::numeric_limits<double>::infinity());
      ASSERT_GT(found, truth - 1e-9);  // never deeper than it is
      off += found > truth + 1e-4 * radius, far_off += found > truth + 0.1 * radius;
    }
    EXPECT_GT(near, 3000);
    EXPECT_LT(off, most_off * near) << radius;
    EXPECT_LT(far_off, most_far_off * near) << radius;
  }
}

}  // namespace
}  // namespace lockstep::contacts_test
