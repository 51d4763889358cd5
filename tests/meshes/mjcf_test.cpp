// Meshes of MJCF files, against MuJoCo. SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>

#include "lockstep/lockstep.h"
#include "mesh_models.h"
#include "meshes.h"
#include "unit/import_helpers.h"

namespace lockstep::meshes {
namespace {

using Eigen::Vector3d;

string mjcf(const string& assets, const string& geoms, const string& compiler = "") {
  return "<mujoco><compiler " + compiler + "/><asset>" + assets + "</asset><worldbody><body name='a'><joint/>" + geoms +
         "</body></worldbody></mujoco>";
}

TEST(MjcfMeshes, are_found_by_meshdir_and_moved_turned_and_scaled) {
  const Folder folder;
  folder.write("assets/u.stl", as_binary_stl(u_mount()));
  folder.write("assets/u.msh", as_msh(u_mount()));
  for (const string compiler : {"meshdir='assets'", "assetdir='assets'", "assetdir='none' meshdir='assets'",
                                "meshdir='assets' strippath='true'", "assetdir='assets' strippath='true'"})
    for (const string file : {"u.stl", "u.msh"}) {
      const string name = compiler.find("strippath") != string::npos ? "x/y/" + file : file;
      const string path = folder.write(
          "r.xml", mjcf("<mesh file='" + name + "' refpos='.1 .2 .3' refquat='.9 .1 .3 -.2' scale='1 2 -1'/>",
                        "<geom type='mesh' mesh='u' pos='1 0 0' euler='90 0 0'/>", compiler));
      const Import import = import_file(path, {.colliders = true});
      Eigen::Affine3d moved = Eigen::Affine3d::Identity();
      moved = Eigen::Translation3d(1, 0, 0) * Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitX()) *
              Eigen::Scaling(1.0, 2.0, -1.0) * Eigen::Quaterniond(.9, .1, .3, -.2).normalized().conjugate() *
              Eigen::Translation3d(-.1, -.2, -.3);
      ASSERT_EQ(import.model.colliders.size(), 1u);
      const std::vector<int> outer = {0, 1, 2, 7, 8, 9, 10, 15};  // the others lie on edges or within
      const Eigen::Matrix3Xd corners = moved * Eigen::Matrix3Xd(u_mount().vertices(Eigen::all, outer));
      for (const auto& corner : corners.colwise())
        EXPECT_LT((placed(import.model.colliders[0]).colwise() - corner).colwise().norm().minCoeff(), 1e-6);
      // MuJoCo 3.14: the mass of 1.7e-2 m^3, and its centre and moments in this pose.
      EXPECT_NEAR(link(import.model, "a").inertia.mass, 17.00000162919367, 2e-5);
    }
  expect_refused(
      [&] {
        return import_file(folder.write("sub/r.xml", mjcf("<mesh file='u.stl'/>", "<geom type='mesh' mesh='u'/>",
                                                          "meshdir='../assets'")),
                           {.colliders = true});
      },
      "mesh 'u'", "outside of the folders", "file_roots");
}

const string u_vertices = [] {
  string text = "vertex='";
  const Eigen::Matrix3Xd vertices = u_mount().vertices;
  for (const auto& vertex : vertices.colwise()) text += words(vertex) + " ";
  return text + "'";
}();
const string u_faces = [] {
  string text = " face='";
  const Eigen::Matrix3Xi triangles = u_mount().triangles;
  for (const int corner : triangles.reshaped()) text += std::to_string(corner) + " ";
  return text + "'";
}();

// What MuJoCo 3.14 makes of this body, rule by rule.
TEST(MjcfMeshes, give_bodies_the_inertia_of_mujoco) {
  struct Fact {
    string rule;
    double mass;
    Vector3d center, moments;
  };
  const Fact facts[] = {{"legacy",
                         17.00000162919367,
                         {0.310377628638055, -0.08974426235148177, 0.0018911009201887097},
                         {0.31942763909251753, 0.30699617697876874, 0.1184505409361843}},
                        {"exact",
                         15.000001490116166,
                         {0.3157021226276876, -0.08868083967149999, 0.0008510641199677149},
                         {0.3068437475109073, 0.29376806568147235, 0.10928093935808449}},
                        {"shell",
                         472.4400424504468,
                         {0.3090657309973741, -0.09000627826398518, 0.0021473547615943334},
                         {12.774597382435124, 12.387248713197742, 5.260019792322017}}};
  for (const Fact& fact : facts) {
    const string asset = "<mesh name='u' inertia='" + fact.rule + "' scale='1 2 -1' refpos='.1 .2 .3' " +
                         "refquat='.9 .1 .3 -.2' " + u_vertices + u_faces + "/>";
    const Import import = import_mjcf(mjcf(asset, "<geom type='mesh' mesh='u' pos='.1 0 .2' quat='.8 .1 .5 .2'/>"));
    const Inertia& inertia = link(import.model, "a").inertia;
    EXPECT_NEAR(inertia.mass, fact.mass, 1e-6 * fact.mass);
    EXPECT_LT((inertia.center - fact.center).norm(), 1e-6);
    const Vector3d moments =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia.about_center).eigenvalues().reverse();
    EXPECT_LT((moments - fact.moments).cwiseQuotient(fact.moments).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_EQ(report_of(import).find("too high as in MuJoCo") != string::npos, fact.rule == "legacy");
  }
  const auto mass = [&](const string& asset, const string& geom, const string& compiler = "") {
    return link(import_mjcf(mjcf("<mesh name='u' " + asset + u_vertices + "/>", geom, compiler)).model, "a")
        .inertia.mass;
  };
  EXPECT_NEAR(mass(u_faces + " ", "<geom type='mesh' mesh='u'/>", "exactmeshinertia='true'"), 7.5, 1e-12);
  EXPECT_NEAR(mass("", "<geom type='mesh' mesh='u'/>"), 9.0, 1e-12) << "without faces it is the hull";
  EXPECT_NEAR(mass("", "<geom type='mesh' mesh='u' mass='3'/>"), 3.0, 1e-12);
  EXPECT_NEAR(mass("", "<geom type='mesh' mesh='u' density='500'/>"), 4.5, 1e-12);
}

// Around the mesh MuJoCo 3.14 puts these primitives, with fitscale 1.1: by its moments, or by its extents (fitaabb).
TEST(MjcfMeshes, have_primitives_around_them_as_in_mujoco) {
  struct Fact {
    string type, aabb;
    Vector3d size;
    double mass;
  };
  const Fact facts[] = {
      {"sphere", "false", {0.12330149138864999, 0, 0}, 7.856429387357345},
      {"capsule", "false", {0.09541872040611156, 0.13135767315067104, 0}, 11.157791689223945},
      {"cylinder", "false", {0.09541872040611156, 0.1790670333537268, 0}, 10.248026358594089},
      {"ellipsoid", "false", {0.08250000327825549, 0.10833743753396764, 0.1790670333537268}, 6.708231507252793},
      {"box", "false", {0.08250000327825549, 0.10833743753396764, 0.1790670333537268}, 12.807967235613717},
      {"sphere", "true", {0.16500000655651137, 0, 0}, 18.820760231990935},
      {"capsule", "true", {0.11000000163912803, 0.055000004917383334, 0}, 9.760929122406864},
      {"cylinder", "true", {0.11000000163912803, 0.16500000655651137, 0}, 12.548569128309445},
      {"ellipsoid", "true", {0.08250000327825568, 0.11000000163912803, 0.16500000655651137}, 6.276379115028641},
      {"box", "true", {0.08250000327825568, 0.11000000163912803, 0.16500000655651137}, 11.983189920711313}};
  const Vector3d by_moments(1.120319152271494, 2.137872346154553, 2.9476595709203406),
      by_extents(1.1292553220657593, 2.1382978777302073, 2.9521276565625314);
  for (const Fact& fact : facts) {
    const Import import =
        import_mjcf(mjcf("<mesh name='u' inertia='exact' " + u_vertices + u_faces + "/>",
                         "<geom type='" + fact.type +
                             "' mesh='u' fitscale='1.1' pos='1 2 3' quat='.8 .1 .5 .2'/><geom size='.01'/>",
                         "fitaabb='" + fact.aabb + "'"),
                    "t", {.colliders = true});
    EXPECT_NEAR(link(import.model, "a").inertia.mass, fact.mass, 2e-6 * fact.mass);
    const Collider& collider = import.model.colliders[0];
    EXPECT_EQ(to_string(collider.shape.kind), fact.type);
    Vector3d size = fact.size;
    if (fact.type == "capsule" || fact.type == "cylinder") size[1] *= 2.0;
    if (fact.type == "box") size *= 2.0;
    EXPECT_LT((collider.shape.size - size).norm(), 1e-7) << fact.type << " " << fact.aabb;
    EXPECT_LT((collider.pose.translation() - (fact.aabb == "true" ? by_extents : by_moments)).norm(), 1e-6);
    // MuJoCo's third axis is the longest one of the mesh, which stands along x there.
    const Vector3d along = Eigen::Quaterniond(.8, .1, .5, .2).normalized() * Vector3d::UnitX();
    EXPECT_GT(std::abs(collider.pose.linear().col(2).dot(along)), fact.type == "sphere" ? -1.0 : 1.0 - 1e-9);
  }
  // A geom that names a mesh and no type is a sphere.
  EXPECT_EQ(import_mjcf(mjcf("<mesh name='u' " + u_vertices + "/>", "<geom mesh='u'/>"), "t", {.colliders = true})
                .model.colliders[0]
                .shape.kind,
            ShapeKind::sphere);
}

TEST(MjcfMeshes, are_opened_only_where_they_are_used) {
  const string asset = "<mesh name='v' file='none.stl'/>";
  const string inertial = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>";
  const string drawn = "<geom type='mesh' mesh='v' contype='0' conaffinity='0'/>";
  EXPECT_TRUE(import_mjcf(mjcf(asset, inertial + drawn), "t", {.colliders = true}).model.colliders.empty());
  EXPECT_NO_THROW(import_mjcf(mjcf(asset, inertial + "<geom type='mesh' mesh='v'/>")));
  EXPECT_NO_THROW(import_mjcf(mjcf(asset, "<geom size='1'/><geom type='mesh' mesh='v' mass='0'/>")));
  EXPECT_NO_THROW(import_mjcf("<mujoco><asset>" + asset +
                                  "</asset><worldbody><body><joint/><geom type='mesh' mesh='v'/>"
                                  "</body><body name='b'><joint/><geom size='1'/></body></worldbody></mujoco>",
                              "t", {.colliders = true, .body = "b"}));
  EXPECT_TRUE(
      import_mjcf(mjcf(asset, inertial + "<geom type='box' mesh='v'/>"), "t", {.colliders = true, .fit = Fit::none})
          .model.colliders.empty());
  const string touches = inertial + "<geom type='mesh' mesh='v'/>";
  const Import left_out = import_mjcf(mjcf(asset, touches), "t", {.colliders = true, .leave_out_meshes = true});
  EXPECT_TRUE(warns(left_out, "geoms with meshes, left out of the colliders on request (1): a"));
  expect_reports(import_mjcf(mjcf(asset, touches), "t", {.colliders = true, .fit_of_links = {{"a", Fit::none}}}),
                 "geoms with meshes that touch nothing: of fit none (1): a");
  const Import made = import_mjcf(mjcf("<mesh name='v' builtin='cone'/>", touches), "t", {.colliders = true});
  EXPECT_TRUE(warns(made, "that of a is one that MuJoCo makes: let MuJoCo save the model"));
}

// As in MuJoCo 3.14, which gives these masses.
TEST(MjcfMeshes, take_defaults_and_turn_inside_out) {
  const string points = " vertex='0 0 0 1 0 0 0 1 0 0 0 1'", geom = "<geom type='mesh' mesh='u'/>";
  const auto mass = [&](const string& defaults, const string& mesh) {
    const string text = mjcf(mesh, geom);
    return link(import_mjcf("<mujoco><default>" + defaults + "</default>" + text.substr(8)).model, "a").inertia.mass;
  };
  EXPECT_NEAR(mass("<mesh scale='.1 .1 .1'/>", "<mesh name='u'" + points + "/>"), 1.0 / 6.0, 1e-12);
  EXPECT_NEAR(mass("<default class='c'><mesh scale='.1 .1 .2'/></default>", "<mesh name='u' class='c'" + points + "/>"),
              2.0 / 6.0, 1e-12);
  EXPECT_NEAR(mass("", "<mesh name='u' face='0 1 2 0 3 1 0 2 3 1 3 2'" + points + "/>"), 1000.0 / 6.0, 1e-9);
  EXPECT_NEAR(mass("", "<mesh name='u' inertia='shell'" + points + "/>"), 1000.0 * (1.5 + std::sqrt(3.0) / 2.0), 1e-9);
}

TEST(MjcfMeshes, that_weigh_too_much_are_named_once_and_where_that_counts) {
  const string asset = "<mesh name='u' " + u_vertices + u_faces + "/>", geom = "<geom type='mesh' mesh='u'/>";
  const auto is_told = [&](const string& geoms) {
    return report_of(import_mjcf(mjcf(asset, geoms), "t", {.colliders = true})).find("too high as in MuJoCo") !=
           string::npos;
  };
  expect_reports(
      import_mjcf(mjcf(asset, geom + geom)),
      "masses of concave meshes, too high as in MuJoCo: inertia=\"exact\" would mend them (1): u 1.13 times");
  EXPECT_FALSE(is_told("<geom type='mesh' mesh='u' mass='3'/>"));
  EXPECT_FALSE(is_told("<geom type='box' mesh='u'/>"));
  EXPECT_FALSE(is_told("<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>" + geom));
}

TEST(MjcfMeshes, that_cannot_be_are_refused_by_name) {
  const auto refused = [](const string& asset, const string& geom, const string& element, const string& rule) {
    expect_refused([&] { return import_mjcf(mjcf(asset, geom)); }, element, rule);
  };
  const string geom = "<geom type='mesh' mesh='u'/>";
  const string points = " vertex='0 0 0 1 0 0 0 1 0 0 0 1'";
  refused("", geom, "<geom>", "mesh 'u', which does not exist");
  refused("", "<geom type='mesh'/>", "<geom>", "mesh '', which does not exist");
  refused("<mesh name='u'/>", geom, "mesh 'u'", "neither a file nor vertices");
  refused("<mesh name='u' file='u.stl'" + points + "/>", geom, "mesh 'u'", "a file and vertices");
  refused("<mesh name='u' file='u.stl'/>", geom, "mesh 'u'", "text without a folder");
  refused("<mesh name='u' builtin='cone'/>", geom, "<geom>", "one that MuJoCo makes");
  refused("<mesh name='u' vertex='0 0 0 1 0 0 0 1 0 0 0'/>", geom, "mesh 'u'", "threes of numbers");
  refused("<mesh name='u' face='0 1 4'" + points + "/>", geom, "mesh 'u'", "a face with 4");
  refused("<mesh name='u' face='0 1 1.5'" + points + "/>", geom, "mesh 'u'", "a face with 1.5");
  refused("<mesh name='u' refquat='0 0 0 0'" + points + "/>", geom, "mesh 'u'", "refquat");
  refused("<mesh name='u' inertia='exact' face='0 2 1'" + points + "/>", geom, "mesh 'u'", "not closed");
  refused("<mesh name='u' vertex='0 0 0 1 0 0 0 1 0 1 1 0'/>", geom, "mesh 'u'", "in a plane");
  refused("<mesh name='u'" + points + "/>", "<geom type='mesh' mesh='u' shellinertia='true'/>", "<geom>", "a shell");
  refused("<mesh name='u'" + points + "/>", "<geom type='box' mesh='u' fitscale='0'/>", "<geom>", "fitscale");
  refused("<mesh name='u' maxhullvert='3'" + points + "/>", geom, "mesh 'u'", "maxhullvert below 4");
  refused("<mesh name='u'" + points + "/><mesh name='u'" + points + "/>", geom, "mesh 'u'", "has a name that is taken");
  refused("<mesh name='u'" + points + "/>", "<geom type='box' mesh='u' fromto='0 0 0 1 1 1'/>", "<geom>",
          "a fromto and a mesh");
  const string flat = "<mesh name='u' inertia='shell' vertex='0 0 0 1 0 0 0 1 0 1 1 0' face='0 1 2 1 3 2'/>";
  refused(flat, "<geom type='box' mesh='u'/>", "<geom>", "a mesh that is flat");
  expect_refused([&] { return import_mjcf(mjcf(flat, "<geom type='box' mesh='u'/>", "fitaabb='true'")); }, "<geom>",
                 "a mesh that is flat");
}

TEST(MjcfMeshes, may_bound_the_corners_of_their_hulls) {
  string vertices = "vertex='";
  const Eigen::Matrix3Xd points = torus(.2, .05, 16, 8).vertices;
  for (const auto& point : points.colwise()) vertices += words(point) + " ";
  const auto corners = [&](const string& bound) {
    return import_mjcf(mjcf("<mesh name='u' " + bound + vertices + "'/>", "<geom type='mesh' mesh='u'/>"), "t",
                       {.colliders = true})
        .model.colliders[0]
        .shape.points.cols();
  };
  EXPECT_EQ(corners("maxhullvert='10' "), 10);
  EXPECT_EQ(corners(""), 64);
}

// A cube of a file rests where a box does, and a fall ends at the height that its size says.
TEST(MeshContacts, a_cube_of_a_file_rests_as_a_box) {
  const Folder folder;
  Mesh cube = block(.1, .1, .1);
  cube.vertices.colwise() -= Vector3d::Constant(.05);
  folder.write("cube.stl", as_binary_stl(cube));
  const auto height = [&](const string& geom) {
    Model model = import_file(folder.write("r.xml",
                                           "<mujoco><asset><mesh file='cube.stl'/></asset><worldbody>"
                                           "<geom type='plane' size='1 1 1'/><body name='a' pos='0 0 .06'>"
                                           "<freejoint/>" +
                                               geom + "</body></worldbody></mujoco>"),
                              {.colliders = true})
                      .model;
    StepSettings settings;
    settings.dt = 0.002;
    Batch<double> batch(compile(model, settings), 1, {.threads = 1});
    for (int i = 0; i < 1000; ++i) batch.step();
    return batch.root_poses()(2, 0);
  };
  const double box = height("<geom type='box' size='.05 .05 .05'/>"), hull = height("<geom type='mesh' mesh='cube'/>");
  EXPECT_NEAR(hull, box, 1e-7);
  EXPECT_NEAR(hull, .05, 1e-4);
}

}  // namespace
}  // namespace lockstep::meshes
