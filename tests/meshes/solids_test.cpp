// What meshes weigh, and the shapes around them. SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <random>
#include <stdexcept>

#include "import/meshes/reduce.h"
#include "import/meshes/solid.h"
#include "meshes.h"
#include "model/shapes.h"
#include "model/trees.h"

namespace lockstep::meshes {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using importer::Fitted;
using importer::MeshRule;
using importer::Solid;

void expect_equal(const Inertia& one, const Inertia& other, double tolerance) {
  EXPECT_NEAR(one.mass, other.mass, tolerance * other.mass);
  EXPECT_LT((one.center - other.center).norm(), tolerance);
  EXPECT_LT((one.about_center - other.about_center).norm(), tolerance * other.about_center.norm());
}

Inertia block_inertia(double x, double y, double z, double mass) {
  return Inertia::box(mass, {x, y, z}, 0.5 * Vector3d(x, y, z));
}

TEST(MeshInertia, is_that_of_a_box_by_three_rules) {
  const Solid solid(block(0.1, 0.2, 0.3));
  for (const MeshRule rule : {MeshRule::legacy, MeshRule::convex, MeshRule::exact})
    expect_equal(solid.inertia(rule), block_inertia(0.1, 0.2, 0.3, 0.006), 1e-13);
}

TEST(MeshInertia, of_a_tetrahedron_is_the_formula) {
  // Of the corners (0, 0, 0), (a, 0, 0), (0, b, 0), (0, 0, c): I_xx = V (b^2 + c^2) 3 / 80 about the centre.
  const Mesh mesh =
      mesh_of({{0, 0, 0}, {.1, 0, 0}, {0, .2, 0}, {0, 0, .3}}, {{{0, 2, 1}}, {{0, 1, 3}}, {{0, 3, 2}}, {{1, 2, 3}}});
  const double volume = .1 * .2 * .3 / 6.0;
  const Inertia inertia = Solid(mesh).inertia(MeshRule::exact);
  EXPECT_NEAR(inertia.mass, volume, 1e-18);
  EXPECT_LT((inertia.center - Vector3d(.025, .05, .075)).norm(), 1e-16);
  EXPECT_NEAR(inertia.about_center(0, 0), volume * (.04 + .09) * 3.0 / 80.0, 1e-18);
  EXPECT_NEAR(inertia.about_center(0, 1), volume * .1 * .2 / 80.0, 1e-18);
}

// A fine torus has the volume and moments of a round one; how far off it is falls with the square of its edges.
TEST(MeshInertia, of_a_torus_nears_that_of_a_round_one) {
  const double pi = std::acos(-1.0), large = 0.2, small = 0.05;
  const double volume = 2.0 * pi * pi * large * small * small;
  const double about_z = volume * (large * large + 0.75 * small * small);
  double before = 1.0;
  for (const int n : {24, 48, 96}) {
    const Inertia inertia = Solid(torus(large, small, 2 * n, n)).inertia(MeshRule::exact);
    const double off = std::abs(inertia.about_center(2, 2) / about_z - 1.0);
    EXPECT_LT(off, 0.26 * before);
    EXPECT_LT(inertia.center.norm(), 1e-15);
    before = off;
  }
  EXPECT_LT(before, 2e-3);
}

TEST(MeshInertia, of_a_shell_is_that_of_six_plates) {
  const double x = .1, y = .2, z = .3;
  Inertia plates;
  for (int axis = 0; axis < 3; ++axis)
    for (const double end : {0.0, 1.0}) {
      Vector3d edges(x, y, z), center = 0.5 * edges;
      center[axis] = end * edges[axis];
      const double area = edges.prod() / edges[axis];
      edges[axis] = 0.0;
      plates = plates + Inertia::box(area, edges, center);
    }
  expect_equal(Solid(block(x, y, z)).inertia(MeshRule::shell), plates, 1e-13);
}

// What MuJoCo 3.14 makes of this mesh with each of its four rules, at 1000 kg/m^3, or kg/m^2 for the shell. It holds
// vertices in float.
TEST(MeshInertia, of_a_concave_mesh_is_that_of_mujoco) {
  struct Fact {
    MeshRule rule;
    double mass;
    Vector3d moments;
  };
  const Fact facts[] = {
      {MeshRule::legacy, 8.500000814596836, {0.09450875506243672, 0.08293751444170973, 0.041946245985145375}},
      {MeshRule::convex, 9.000000849366213, {0.09750001545995572, 0.08437501466833154, 0.046875006658956775}},
      {MeshRule::exact, 7.500000745058083, {0.09050001478691987, 0.08031251412506, 0.038312505691002134}},
      {MeshRule::shell, 280.00001803040533, {4.363095793198364, 3.8833338753941447, 2.2797621731728834}}};
  const Solid solid(u_mount());
  for (const Fact& fact : facts) {
    const Inertia inertia = solid.inertia(fact.rule);
    EXPECT_NEAR(1000.0 * inertia.mass, fact.mass, 1e-6 * fact.mass);
    const Vector3d moments =
        1000.0 * Eigen::SelfAdjointEigenSolver<Matrix3d>(inertia.about_center).eigenvalues().reverse();
    EXPECT_LT((moments - fact.moments).cwiseQuotient(fact.moments).cwiseAbs().maxCoeff(), 1e-6);
  }
  EXPECT_NEAR(solid.share_of_hull(), 7.5 / 9.0, 1e-14);
}

TEST(MeshInertia, refuses_what_has_no_volume_or_holes) {
  Mesh open = block(1, 1, 1), inside_out = open;
  open.triangles.conservativeResize(3, open.triangles.cols() - 1);
  inside_out.triangles.row(1).swap(inside_out.triangles.row(2));
  const auto rule_of = [](const Mesh& mesh, MeshRule rule) -> std::string {
    try {
      Solid(mesh).inertia(rule);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(rule_of(open, MeshRule::exact).find("not closed"), std::string::npos);
  EXPECT_EQ(rule_of(open, MeshRule::convex), "");
  EXPECT_NE(rule_of(inside_out, MeshRule::exact).find("inside out"), std::string::npos);
  const Mesh flat = mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{{0, 1, 2}}, {{1, 3, 2}}});
  EXPECT_NE(rule_of(flat, MeshRule::legacy).find("no volume"), std::string::npos);
  EXPECT_NE(rule_of(flat, MeshRule::convex).find("in a plane"), std::string::npos);
  EXPECT_EQ(rule_of(flat, MeshRule::shell), "");
  EXPECT_EQ(rule_of(inside_out, MeshRule::legacy), "") << "MuJoCo takes it";
}

// MuJoCo 3.14 gives points without faces those of their hull, for a shell, too.
TEST(MeshInertia, of_points_is_that_of_their_hull) {
  const Mesh whole = block(1, 2, 3);
  const Solid points(Mesh{whole.vertices, Eigen::Matrix3Xi(3, 0)}), faces(whole);
  for (const MeshRule rule : {MeshRule::legacy, MeshRule::convex, MeshRule::exact, MeshRule::shell})
    expect_equal(points.inertia(rule), faces.inertia(rule), 1e-12);
  EXPECT_NEAR(points.share_of_hull(), 1.0, 1e-12);
}

// Wherever the middle of its extents lies, outside of the hull, too.
TEST(Hulls, have_their_corners_below_all_faces) {
  const Eigen::Matrix3d edges = Eigen::Vector3d(1.0, 0.2, 3.0).asDiagonal();
  Eigen::Matrix3Xd corner(3, 4);
  corner << Vector3d::Zero(), edges;
  for (const Eigen::Matrix3Xd& points : {corner, torus(.2, .05, 12, 6).vertices, block(1, 2, 3).vertices}) {
    const Hull hull = hull_of(points);
    for (const HullFace& face : hull.faces) {
      const Eigen::RowVectorXd heights =
          face.normal.transpose() * (hull.corners.colwise() - hull.corners.col(face.corners[0]));
      EXPECT_LT(heights.maxCoeff(), 1e-6);
      const Vector3d a = hull.corners.col(face.corners[0]), b = hull.corners.col(face.corners[1]),
                     c = hull.corners.col(face.corners[2]);
      EXPECT_GT((b - a).cross(c - a).dot(face.normal), 0.0);
    }
  }
}

Eigen::Matrix3Xd points_on_ellipsoid(int count, const Vector3d& axes) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Eigen::Matrix3Xd points(3, count);
  for (auto point : points.colwise()) point = Vector3d(normal(random), normal(random), normal(random)).normalized();
  return axes.asDiagonal() * points;
}

// Fewer corners lie farther inside, all corners are some of the hull's, and the error is that of the support function:
// the distance of two convex bodies, one in the other, is the largest difference of their supports.
TEST(ReducedHulls, say_how_far_inside_they_are) {
  const Hull whole = hull_of(points_on_ellipsoid(900, {.3, .1, .05}));
  double before = 1.0;
  for (const int corners : {8, 16, 32, 64}) {
    const Fitted fitted = importer::fitted(whole, Fit::hull, corners);
    EXPECT_EQ(fitted.corners, corners);
    const Eigen::Matrix3Xd points = fitted.pose * fitted.shape.points;
    for (const auto& point : points.colwise())
      EXPECT_LT((whole.corners.colwise() - point).colwise().norm().minCoeff(), 1e-15);
    double gap = 0.0;
    const Eigen::Matrix3Xd directions = points_on_ellipsoid(20000, Vector3d::Ones());
    for (const auto& direction : directions.colwise())
      gap = std::max(gap,
                     (direction.transpose() * whole.corners).maxCoeff() - (direction.transpose() * points).maxCoeff());
    EXPECT_LE(gap, fitted.inside * (1.0 + 1e-12));
    EXPECT_GT(gap, 0.9 * fitted.inside);
    EXPECT_LT(fitted.inside, before);
    before = fitted.inside;
  }
  EXPECT_LT(before, 0.03);
  EXPECT_EQ(importer::fitted(hull_of(u_mount().vertices), Fit::hull, 8).inside, 0.0) << "eight corners are all";
}

TEST(DistanceOutside, is_that_of_face_edge_and_corner) {
  const Hull hull = hull_of(block(1, 1, 1).vertices);
  EXPECT_EQ(importer::distance_outside(hull, {.5, .5, .9}), 0.0);
  EXPECT_NEAR(importer::distance_outside(hull, {.5, .5, 1.5}), .5, 1e-15);
  EXPECT_NEAR(importer::distance_outside(hull, {1.3, .5, 1.4}), .5, 1e-15);
  EXPECT_NEAR(importer::distance_outside(hull, {2, 3, 3}), 3.0, 1e-15);
}

// Turned by any angles, a box is found again, and a capsule and box hold all points.
TEST(Fits, enclose_the_hull) {
  const Eigen::Isometry3d pose(Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()));
  const Hull turned = hull_of(pose * block(.1, .2, .4).vertices);
  const Fitted box = importer::fitted(turned, Fit::box, 64);
  EXPECT_NEAR(solid_of(box.shape).mass, .008, 1e-12);
  const Hull rounded = hull_of(pose * points_on_ellipsoid(300, {.3, .1, .1}));
  const Fitted around = importer::fitted(rounded, Fit::box, 64), capsule = importer::fitted(rounded, Fit::capsule, 64);
  const Eigen::Matrix3Xd in_box = around.pose.inverse() * rounded.corners;
  EXPECT_LT((in_box.cwiseAbs().rowwise().maxCoeff() - 0.5 * around.shape.size).maxCoeff(), 1e-12);
  ASSERT_EQ(capsule.shape.kind, ShapeKind::capsule);
  const Eigen::Matrix3Xd in_capsule = capsule.pose.inverse() * rounded.corners;
  for (const auto& point : in_capsule.colwise()) {
    const double half = 0.5 * capsule.shape.size[1], z = point.z() - std::clamp(point.z(), -half, half);
    EXPECT_LT(Vector3d(point.x(), point.y(), z).norm(), capsule.shape.size[0] + 1e-12);
  }
  EXPECT_LT(solid_of(capsule.shape).mass, 1.6 * solid_of(rounded).mass);
}

}  // namespace
}  // namespace lockstep::meshes
