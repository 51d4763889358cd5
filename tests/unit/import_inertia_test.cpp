// Inertias of files: judged where they move, repaired by the least change, made from shapes.
// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <functional>
#include <random>

#include "import_helpers.h"
#include "lockstep/error.h"
#include "model/inertia.h"
#include "model/trees.h"

namespace lockstep {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using std::string;

string tensor_text(const Matrix3d& tensor) {
  char text[300];
  std::snprintf(text, sizeof text, "<inertia ixx='%.17g' ixy='%.17g' ixz='%.17g' iyy='%.17g' iyz='%.17g' izz='%.17g'/>",
                tensor(0, 0), tensor(0, 1), tensor(0, 2), tensor(1, 1), tensor(1, 2), tensor(2, 2));
  return text;
}

string moments(double x, double y, double z) { return tensor_text(Vector3d(x, y, z).asDiagonal()); }

string link_text(const string& name, const string& inside) { return "<link name='" + name + "'>" + inside + "</link>"; }

string inertial(double mass, const string& tensor, const string& origin = "") {
  return "<inertial>" + origin + "<mass value='" + std::to_string(mass) + "'/>" + tensor + "</inertial>";
}

string joint_text(const string& name, const string& type, const string& parent, const string& child) {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child +
         "'/><axis xyz='0 0 1'/></joint>";
}

// Link `body` turns about z; `around` is what else there is.
string turning(const string& inside, const string& around = "") {
  return "<robot name='r'><link name='base'/>" + link_text("body", inside) +
         joint_text("turn", "continuous", "base", "body") + around + "</robot>";
}

Inertia body_of(const Model& model, const string& link) {
  return rigid_bodies(model, Trees(model))[model.link_index(link)];
}

string welded(const string& inside) {
  return link_text("plate", inside) +
         "<joint name='weld' type='fixed'><parent link='body'/><child link='plate'/><origin xyz='0 0 0.2' "
         "rpy='0.3 0.2 0.1'/></joint>";
}

TEST(Inertias, are_judged_as_part_of_the_body_that_moves) {
  const string body = inertial(4.0, moments(0.03, 0.03, 0.02));
  const string plate = welded(inertial(0.05, moments(0.01, 0.001, 0.001)));
  const Import import = import_urdf(turning(body, plate));
  expect_reports(import,
                 "impossible inertias that are not judged alone: of a bolted root, or part of a possible body (1): "
                 "plate");
  // A repair changes nothing where nothing needs it.
  const Import repaired = import_urdf(turning(body, plate), "", {.repair_inertias = true});
  EXPECT_EQ(link(repaired.model, "plate").inertia.about_center, link(import.model, "plate").inertia.about_center);
  EXPECT_TRUE(repaired.warnings.empty());
  // The same plate on a light body is impossible as a whole, and the plate is named.
  try {
    import_urdf(turning(inertial(0.1, moments(1e-4, 1e-4, 1e-4)), plate));
    FAIL();
  } catch (const ModelError& error) {
    EXPECT_TRUE(error.element().ends_with("link 'plate'")) << error.what();
    EXPECT_NE(error.remedy().find("ImportOptions::repair_inertias"), string::npos) << error.what();
  }
}

TEST(Inertias, of_a_bolted_root_are_not_judged) {
  const string text = "<robot name='r'>" + link_text("root", inertial(0.2, moments(0.001, 0.0002, 0.0002))) +
                      link_text("finger", unit_body) + joint_text("j", "continuous", "root", "finger") + "</robot>";
  expect_reports(import_urdf(text),
                 "impossible inertias that are not judged alone: of a bolted root, or part of a possible body (1): "
                 "root");
  Model floating = import_urdf(text).model;
  floating.roots[0].floating = true;
  EXPECT_THROW(floating.validate(), ModelError);
}

TEST(Inertias, of_massless_links_add_to_the_body) {
  const Import import =
      import_urdf(turning(inertial(0.3, moments(8e-4, 8e-4, 1e-4)), welded(inertial(0.0, moments(1e-6, 1e-6, 1e-6)))));
  EXPECT_TRUE(warns(import, "inertia, but no mass (1): plate"));
  EXPECT_NEAR(body_of(import.model, "body").about_center(2, 2), 1.01e-4, 1e-18);
}

// Rounded to five digits, a plate's largest moment exceeds the sum of the others by 1e-8 of 4e-4.
TEST(Inertias, may_be_off_by_the_rounding_of_a_file_and_no_more) {
  EXPECT_TRUE(import_urdf(turning(inertial(0.1, moments(8.333e-5, 3.3333e-4, 4.1667e-4)))).warnings.empty());
  EXPECT_THROW(import_urdf(turning(inertial(0.1, moments(8.333e-5, 3.3333e-4, 4.2e-4)))), ModelError);
}

// Noise is what is small beside m l^2. A body of 1.3 kg cannot be smaller than a ball of osmium of 24 mm.
TEST(Inertias, of_a_point_mass_may_have_noise) {
  const string origin = "<origin xyz='0.02 0 0.06'/>";
  for (const double noise : {1e-17, -1e-17}) {
    const Import import = import_urdf(turning(inertial(1.3, moments(noise, 0, -noise), origin)));
    EXPECT_TRUE(import.warnings.empty());
  }
  EXPECT_THROW(import_urdf(turning(inertial(1.3, moments(-1e-7, 1e-3, 1e-3), origin))), ModelError);
  // Noise alone is no inertia about the axis.
  EXPECT_THROW(import_urdf(turning(inertial(1.3, moments(1e-17, 1e-17, 1e-17)))), ModelError);
}

bool is_possible(const Vector3d& moments, double slack) {
  const Vector3d sorted = Eigen::SelfAdjointEigenSolver<Matrix3d>(Matrix3d(moments.asDiagonal())).eigenvalues();
  return sorted[0] + sorted[1] >= sorted[2] - slack;
}

// The nearest point of a convex cone is the one for which the change is at a right angle to it and points away from
// every other point of the cone (Moreau). The edges of the cone are the moments of thin rods (0, 1, 1), so their
// directions suffice.
TEST(Inertias, are_repaired_by_the_least_change) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> size(-0.6, 1.0);
  int repaired = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3d moments(size(random), size(random), size(random));
    const Eigen::Quaterniond turn = Eigen::Quaterniond(size(random), size(random), size(random), 1.0).normalized();
    Matrix3d tensor = turn * moments.asDiagonal() * turn.inverse();
    tensor = Matrix3d(tensor.selfadjointView<Eigen::Upper>());
    const string text = turning(inertial(1.0, tensor_text(tensor), "<origin xyz='1 0 0'/>"));
    const Import import = import_urdf(text, "", {.repair_inertias = true});
    const Matrix3d change = link(import.model, "body").inertia.about_center - tensor;
    if (is_possible(moments, 1e-9)) {
      EXPECT_TRUE(change.isZero(0.0)) << moments.transpose();
      continue;
    }
    if (is_possible(moments, 2e-3)) continue;  // passes as rounding
    ++repaired;
    const Matrix3d back = turn.inverse() * change * turn;
    EXPECT_TRUE(back.isDiagonal(1e-10)) << back;
    const Vector3d nearest = moments + back.diagonal();
    EXPECT_TRUE(is_possible(nearest, 1e-12)) << nearest.transpose();
    EXPECT_NEAR(back.diagonal().dot(nearest), 0.0, 1e-12) << moments.transpose();
    for (const Vector3d& rod : {Vector3d(0, 1, 1), Vector3d(1, 0, 1), Vector3d(1, 1, 0)})
      EXPECT_GE(back.diagonal().dot(rod), -1e-12) << moments.transpose();
    EXPECT_TRUE(warns(import, "changed to the nearest possible (1): body"));
  }
  EXPECT_GT(repaired, 500);
}

// The change is that of the whole body, in the axes of the link that is at fault.
TEST(Inertias, of_welded_links_are_repaired_in_the_link_at_fault) {
  const string text =
      turning(inertial(0.1, moments(1e-4, 1e-4, 1e-4)), welded(inertial(0.05, moments(0.01, 0.001, 0.001))));
  const Import import = import_urdf(text, "", {.repair_inertias = true});
  EXPECT_TRUE(warns(import, "changed to the nearest possible (1): plate"));
  EXPECT_EQ(link(import.model, "body").inertia.about_center, Matrix3d(Vector3d(1e-4, 1e-4, 1e-4).asDiagonal()));
  const Vector3d repaired = principal_moments(body_of(import.model, "body"));
  EXPECT_NEAR(repaired[0] + repaired[1], repaired[2], 1e-15) << "the nearest one lies on the edge of what is possible";
}

TEST(Inertias, that_are_too_small_are_raised_no_more_than_needed) {
  const Import import = import_urdf(turning(inertial(1.0, moments(1e-6, 2e-3, 2e-3))), "", {.least_inertia = 1e-5});
  EXPECT_TRUE(link(import.model, "body")
                  .inertia.about_center.isApprox(Vector3d(1e-5, 2e-3, 2e-3).asDiagonal().toDenseMatrix(), 1e-12));
}

// --- shapes --------------------------------------------------------------------------------------

// Random points say what the formulas say.
Inertia sampled(const Vector3d& half, const std::function<bool(const Vector3d&)>& contains) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(-1.0, 1.0);
  constexpr int points = 400000;
  const double volume = 8.0 * half.prod() / points;
  Matrix3d second = Matrix3d::Zero();
  Inertia sum;
  for (int i = 0; i < points; ++i) {
    const Vector3d point = half.cwiseProduct(Vector3d(share(random), share(random), share(random)));
    if (!contains(point)) continue;
    sum.mass += volume;
    second += volume * point * point.transpose();
  }
  sum.about_center = second.trace() * Matrix3d::Identity() - second;
  return sum;
}

TEST(Shapes, have_the_inertia_of_their_points) {
  const auto solid = [](const string& geometry) {
    const Import import =
        import_urdf(turning("<collision><geometry>" + geometry + "</geometry></collision>"), "", {.density = 500.0});
    EXPECT_TRUE(warns(import, "inertia from collision shapes of 500 kg/m^3 (1): body"));
    return link(import.model, "body").inertia;
  };
  const auto expect = [&](const string& geometry, const Vector3d& half,
                          const std::function<bool(const Vector3d&)>& is_in) {
    const Inertia made = solid(geometry), points = sampled(half, is_in);
    EXPECT_NEAR(made.mass, 500.0 * points.mass, 0.01 * made.mass) << geometry;
    EXPECT_LT((made.about_center - 500.0 * points.about_center).norm(), 0.01 * made.about_center.norm()) << geometry;
  };
  const auto radius = [](const Vector3d& p) { return p.head<2>().norm(); };
  expect("<box size='0.2 0.4 0.6'/>", {0.1, 0.2, 0.3}, [](const Vector3d&) { return true; });
  expect("<sphere radius='0.3'/>", {0.3, 0.3, 0.3}, [](const Vector3d& p) { return p.norm() < 0.3; });
  expect("<cylinder radius='0.3' length='0.8'/>", {0.3, 0.3, 0.4}, [&](const Vector3d& p) { return radius(p) < 0.3; });
  expect("<capsule radius='0.3' length='0.8'/>", {0.3, 0.3, 0.7},
         [](const Vector3d& p) { return (p - Vector3d(0, 0, std::clamp(p.z(), -0.4, 0.4))).norm() < 0.3; });
}

TEST(Shapes, stand_where_their_origins_put_them) {
  const string at = "<origin xyz='1 2 3' rpy='0 0 1.5707963267948966'/>";
  const string box = "<geometry><box size='0.2 0.4 0.6'/></geometry>";
  const Inertia inertia =
      link(import_urdf(turning("<collision>" + at + box + "</collision>"), "", {.density = 1000.0}).model, "body")
          .inertia;
  const Inertia expected = Inertia::box(48.0, {0.4, 0.2, 0.6}, {1, 2, 3});
  EXPECT_NEAR(inertia.mass, 48.0, 1e-12);
  EXPECT_LT((inertia.center - expected.center).norm(), 1e-12);
  EXPECT_LT((inertia.about_center - expected.about_center).norm(), 1e-12);
}

// Two boxes side by side are one box.
TEST(Shapes, of_one_link_are_added_up) {
  const auto box = [](const string& x, const string& length) {
    return "<collision><origin xyz='" + x + " 0 0'/><geometry><box size='" + length +
           " 0.1 0.2'/></geometry></collision>";
  };
  const Inertia parts =
      link(import_urdf(turning(box("0.05", "0.1") + box("0.2", "0.2")), "", {.density = 1000.0}).model, "body").inertia;
  const Inertia whole = link(import_urdf(turning(box("0.15", "0.3")), "", {.density = 1000.0}).model, "body").inertia;
  EXPECT_NEAR(parts.mass, whole.mass, 1e-12);
  EXPECT_LT((parts.center - whole.center).norm(), 1e-12);
  EXPECT_LT((parts.about_center - whole.about_center).norm(), 1e-12);
}

TEST(Shapes, give_an_inertial_what_it_lacks) {
  const string ball = "<collision><geometry><sphere radius='0.1'/></geometry></collision>";
  const double volume = 4.0 / 3.0 * std::acos(-1.0) * 1e-3;
  const auto made = [&](const string& inertial_text) {
    return link(import_urdf(turning(inertial_text + ball), "", {.density = 1000.0}).model, "body").inertia;
  };
  const Inertia of_mass = made(inertial(2.0, "", "<origin xyz='0.5 0 0'/>"));
  EXPECT_EQ(of_mass.mass, 2.0);
  EXPECT_EQ(of_mass.center, Vector3d(0.5, 0, 0));
  EXPECT_NEAR(of_mass.about_center(0, 0), 0.4 * 2.0 * 0.01, 1e-15);
  const Inertia of_tensor = made("<inertial>" + moments(1, 1, 1) + "</inertial>");
  EXPECT_NEAR(of_tensor.mass, 1000.0 * volume, 1e-12);
  EXPECT_EQ(of_tensor.about_center(0, 0), 1.0);
  EXPECT_NEAR(made(inertial(0.0, "")).mass, 1000.0 * volume, 1e-12) << "a mass of 0 is none";
  const Inertia complete = made(inertial(2.0, moments(1, 1, 1)));
  EXPECT_EQ(complete.mass, 2.0);
  EXPECT_EQ(complete.about_center(0, 0), 1.0);
}

// What is not needed is not judged, and is counted.
TEST(Shapes, of_bodies_with_inertia_are_not_used) {
  const string flat = "<collision><geometry><box size='0 0 0'/></geometry></collision>";
  const string box = "<collision><geometry><box size='1 1 1'/></geometry></collision>";
  const Import import =
      import_urdf(turning(inertial(2.0, moments(1, 1, 1)) + flat, welded(box)), "", {.density = 1000.0});
  EXPECT_EQ(body_of(import.model, "body").mass, 2.0);
  expect_reports(import, "not used: 2 collision");
}

TEST(Shapes, that_are_meshes_are_named_where_they_are_left_out) {
  const string mesh = "<collision><geometry><mesh filename='none.stl'/></geometry></collision>";
  const string ball = "<collision><geometry><sphere radius='0.1'/></geometry></collision>";
  try {
    import_urdf(turning(mesh), "", {.density = 1000.0, .leave_out_meshes = true});
    FAIL();
  } catch (const ModelError& error) {
    EXPECT_NE(error.rule().find("collision meshes, not used for inertia (1): body"), string::npos) << error.what();
  }
  EXPECT_TRUE(warns(import_urdf(turning(mesh + ball), "", {.density = 1000.0, .leave_out_meshes = true}),
                    "collision meshes, not used for inertia (1): body"));
  EXPECT_THROW(
      import_urdf(turning("<collision><geometry><sphere radius='0'/></geometry></collision>"), "", {.density = 1000.0}),
      ModelError);
}

TEST(Inertias, that_are_missing_are_named_all_at_once) {
  const string text =
      turning("", link_text("next", "") + link_text("last", inertial(1.0, "")) +
                      joint_text("j", "continuous", "base", "next") + joint_text("k", "continuous", "base", "last"));
  try {
    import_urdf(text);
    FAIL();
  } catch (const ModelError& error) {
    EXPECT_NE(error.rule().find("the same holds for next, last"), string::npos) << error.what();
    for (const char* option : {"density", "least_mass", "least_inertia"})
      EXPECT_NE(error.remedy().find(string("ImportOptions::") + option), string::npos) << error.what();
  }
}

// URDF has no armatures. They can make up for an inertia that is missing.
TEST(Changes, are_made_before_the_model_is_judged) {
  const Import import = import_urdf(turning(""), "", {.change = [](Model& model) { model.joints[0].armature = 0.1; }});
  EXPECT_EQ(import.model.joints[0].armature, 0.1);
  EXPECT_THROW(import_urdf(turning("")), ModelError);
  const auto float_root = [](Model& model) { model.roots[0].floating = true; };
  const Import floating =
      import_urdf(turning(unit_body), "", {.least_mass = 0.1, .least_inertia = 0.1, .change = float_root});
  EXPECT_TRUE(warns(floating, "masses raised to 0.1 kg (1): base"));
}

}  // namespace
}  // namespace lockstep
