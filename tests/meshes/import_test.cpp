// Meshes of robot files: where they lie, what becomes of them, and what is refused. SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <filesystem>

#include "lockstep/lockstep.h"
#include "meshes.h"
#include "unit/import_helpers.h"

namespace lockstep::meshes {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using std::string;

// A link on a hinge, with the collision elements.
string urdf(const string& collisions, const string& inertial = unit_body) {
  return "<robot name='r'><link name='base'/><link name='arm'>" + inertial + collisions +
         "</link><joint name='j' type='continuous'><parent link='base'/><child link='arm'/></joint></robot>";
}
string mesh(const string& file, const string& more = "") {
  return "<collision><origin xyz='1 2 3'/><geometry><mesh filename='" + file + "' " + more +
         "/></geometry></collision>";
}
string mjcf(const string& assets, const string& geoms, const string& compiler = "") {
  return "<mujoco><compiler " + compiler + "/><asset>" + assets + "</asset><worldbody><body name='a'><joint/>" + geoms +
         "</body></worldbody></mujoco>";
}

Eigen::Matrix3Xd placed(const Collider& collider) { return collider.pose * collider.shape.points; }

// The corners of one are those of the other, to the rounding of a file.
void expect_corners(const Collider& collider, const Eigen::Matrix3Xd& wanted) {
  const Eigen::Matrix3Xd own = placed(collider);
  ASSERT_EQ(own.cols(), wanted.cols());
  for (const auto& corner : wanted.colwise())
    EXPECT_LT((own.colwise() - corner).colwise().norm().minCoeff(), 1e-6) << corner.transpose();
}

template <class Refused = ImportError>
void expect_refused(const std::function<Import()>& read, const string& element, const string& rule,
                    const string& remedy = "") {
  try {
    read();
    ADD_FAILURE() << "read, in place of: " << rule;
  } catch (const Refused& error) {
    EXPECT_NE(error.element().find(element), string::npos) << error.what();
    EXPECT_NE(error.rule().find(rule), string::npos) << error.what();
    EXPECT_NE(error.remedy().find(remedy), string::npos) << error.what();
  }
}

TEST(UrdfMeshes, become_hulls_where_the_file_puts_them) {
  const Folder folder;
  folder.write("b.stl", as_binary_stl(block(100, 200, 300)));
  const string path = folder.write("r.urdf", urdf(mesh("b.stl", "scale='0.001 0.001 -0.002'")));
  const Import import = import_file(path, {.colliders = true});
  ASSERT_EQ(import.model.colliders.size(), 1u);
  const Collider& collider = import.model.colliders[0];
  EXPECT_EQ(collider.name, "arm");
  EXPECT_EQ(collider.link, "arm");
  EXPECT_EQ(collider.group, "robot");
  EXPECT_EQ(collider.shape.kind, ShapeKind::hull);
  expect_corners(collider, block(.1, .2, -.6).vertices.colwise() + Vector3d(1, 2, 3));
  EXPECT_LT((collider.shape.points.rowwise().mean()).norm(), 1e-7) << "points are told from the centre";
}

// In the folder, in a package that is given, around the file, or beside a folder around it; else nowhere.
TEST(UrdfMeshes, are_found_where_they_may_lie) {
  const Folder folder;
  const string stl = as_binary_stl(block(1, 1, 1));
  folder.write("ws/arm_description/meshes/a.stl", stl);
  folder.write("ws/hand_description/meshes/h.STL", stl);
  folder.write("elsewhere/e.stl", stl);
  fs::create_symlink(folder / "elsewhere/e.stl", folder / "ws/arm_description/link.stl");
  const auto read = [&](const string& name, ImportOptions options = {}) {
    options.colliders = true;
    return import_urdf_file(folder.write("ws/arm_description/urdf/r.urdf", urdf(mesh(name))), options);
  };
  EXPECT_EQ(read("package://arm_description/meshes/a.stl").model.colliders.size(), 1u);
  EXPECT_EQ(read("package://hand_description/meshes/h.STL").model.colliders.size(), 1u);
  EXPECT_EQ(read("package://given/e.stl", {.packages = {{"given", folder / "elsewhere"}}}).model.colliders.size(), 1u);
  EXPECT_EQ(read("../meshes/a.stl", {.mesh_roots = {folder / "ws"}}).model.colliders.size(), 1u);
  EXPECT_EQ(
      read("file://" + (folder / "elsewhere/e.stl"), {.mesh_roots = {folder / "elsewhere"}}).model.colliders.size(),
      1u);
  EXPECT_EQ(read("package://arm_description/link.stl", {.mesh_roots = {folder / "elsewhere"}}).model.colliders.size(),
            1u);
  const auto refused = [&](const string& name, const string& rule, const string& remedy) {
    expect_refused([&] { return read(name); }, "r.urdf:1: <mesh> of link 'arm'", rule, remedy);
  };
  refused("../meshes/a.stl", "outside of the folders", "mesh_roots");
  refused("package://arm_description/../../elsewhere/e.stl", "outside of the folders", "mesh_roots");
  refused("package://arm_description/link.stl", "outside of the folders", "mesh_roots");
  refused(folder / "elsewhere/e.stl", "outside of the folders", "mesh_roots");
  refused("file://" + (folder / "elsewhere/e.stl"), "outside of the folders", "mesh_roots");
  refused("package://nowhere/e.stl", "in package 'nowhere'", "ImportOptions::packages");
  refused("package://../e.stl", "in package '..'", "ImportOptions::packages");
  fs::create_directories(folder / "ws/out");
  fs::create_symlink(folder / "elsewhere", folder / "ws/linked");
  refused("package://linked/e.stl", "in package 'linked'", "ImportOptions::packages");
  refused("package://" + fs::temp_directory_path().filename().string() + "/e.stl", "in package '",
          "ImportOptions::packages");
  refused("package://etc/passwd.stl", "in package 'etc'", "ImportOptions::packages");
  refused("https://example.org/e.stl", "no file here", "package://");
  refused("none.stl", "does not exist", "leave_out_meshes");
  expect_refused([&] { return import_urdf(urdf(mesh("a.stl")), "text", {.colliders = true}); }, "text:1",
                 "text without a folder", "leave_out_meshes");
  const auto setting = [&](const ImportOptions& options, const string& element) {
    expect_refused<SettingsError>([&] { return read("package://arm_description/meshes/a.stl", options); }, element, "");
  };
  setting({.packages = {{"p", folder / "none"}}}, "ImportOptions::packages");
  setting({.mesh_roots = {folder / "none"}}, "ImportOptions::mesh_roots");
  setting({.hull_vertices = 7}, "ImportOptions::hull_vertices");
  setting({.hull_vertices = 65}, "ImportOptions::hull_vertices");
  setting({.fit_of_links = {{"amr", Fit::box}}}, "ImportOptions::fit_of_links");
}

// Whoever does not ask for a mesh may lack it.
TEST(UrdfMeshes, are_opened_only_where_they_are_used) {
  const string text = urdf(mesh("none.stl") + mesh("none.dae"));
  EXPECT_TRUE(import_urdf(text).warnings.empty());
  EXPECT_TRUE(import_urdf(text, "t", {.density = 1000.0}).model.colliders.empty());
  const Import left_out = import_urdf(text, "t", {.colliders = true, .leave_out_meshes = true});
  expect_reports(left_out, "collision meshes, left out on request (2): arm, arm");
  EXPECT_TRUE(warns(left_out, "left out on request"));
  const Import of_no_fit = import_urdf(urdf(mesh("none.stl")), "t", {.colliders = true, .fit = Fit::none});
  expect_reports(of_no_fit, "collision meshes that touch nothing: of fit none (1): arm");
  const Import dae = import_urdf(urdf(mesh("a.DAE")), "t", {.colliders = true});
  expect_reports(dae, "collision meshes, left out (1): that of arm is COLLADA, which is not read: convert it to STL");
  EXPECT_TRUE(warns(dae, "COLLADA"));
}

TEST(UrdfMeshes, weigh_as_closed_ones_or_as_their_hulls) {
  const Folder folder;
  Mesh open = u_mount();
  open.triangles.conservativeResize(3, open.triangles.cols() - 1);
  folder.write("closed.obj", as_obj(u_mount()));
  folder.write("open.obj", as_obj(open));
  const auto read = [&](const string& name) {
    return import_urdf_file(folder.write("r.urdf", urdf(mesh(name), "")), {.density = 1000.0});
  };
  const Import closed = read("closed.obj"), hull = read("open.obj");
  EXPECT_NEAR(link(closed.model, "arm").inertia.mass, 7.5, 1e-12);
  EXPECT_LT((link(closed.model, "arm").inertia.center - Vector3d(1.15, 2.075, 3.09)).norm(), 1e-12);
  EXPECT_FALSE(warns(closed, "not closed"));
  EXPECT_NEAR(link(hull.model, "arm").inertia.mass, 9.0, 1e-12);
  EXPECT_TRUE(warns(hull, "collision meshes that are not closed, whose hulls give inertia (1): arm"));
}

TEST(UrdfMeshes, tell_what_their_hulls_lose) {
  const Folder folder;
  folder.write("torus.stl", as_binary_stl(torus(.2, .05, 40, 20)));
  folder.write("large.stl", as_binary_stl(block(200, 100, 100)));
  const auto read = [&](const string& name, const ImportOptions& options) {
    return import_urdf_file(folder.write("r.urdf", urdf(mesh(name))), options);
  };
  const Import fine = read("torus.stl", {.colliders = true}),
               coarse = read("torus.stl", {.colliders = true, .hull_vertices = 12});
  EXPECT_EQ(fine.model.colliders[0].shape.points.cols(), 64);
  EXPECT_EQ(coarse.model.colliders[0].shape.points.cols(), 12);
  for (const Import* import : {&fine, &coarse}) {
    EXPECT_NE(report_of(*import).find("hulls of fewer corners than those of their meshes (1): arm: "), string::npos);
    EXPECT_TRUE(warns(
        *import, "concave meshes, whose hulls fill their hollows: split them where that matters (1): arm fills 0."));
  }
  EXPECT_TRUE(warns(read("large.stl", {.colliders = true}), "perhaps in millimetres (1): arm: 200 m"));
  const Import box = read("torus.stl", {.colliders = true, .fit_of_links = {{"arm", Fit::box}}});
  EXPECT_EQ(box.model.colliders[0].shape.kind, ShapeKind::box);
  EXPECT_LT((box.model.colliders[0].pose.translation() - Vector3d(1, 2, 3)).norm(), 1e-7);
}

// Hostile files: each an error that names it, in bounded time and memory.
TEST(HostileMeshes, are_refused_by_name) {
  const Folder folder;
  const auto refused = [&](const string& name, const string& element, const string& rule) {
    expect_refused([&] { return import_urdf_file(folder.write("r.urdf", urdf(mesh(name))), {.colliders = true}); },
                   element, rule);
  };
  fs::create_directory(folder / "folder.stl");
  ASSERT_EQ(mkfifo((folder / "pipe.stl").c_str(), 0600), 0);
  folder.write("huge.stl", "");
  fs::resize_file(folder / "huge.stl", std::uintmax_t{65} << 20);
  folder.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3 4\n");
  folder.write("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3\n");
  folder.write("three.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  folder.write("nan.obj", "v 0 0 0\nv nan 0 0\n");
  string many;
  for (int i = 0; i < 500001; ++i) many += "v 0 0 " + std::to_string(i) + "\n";
  folder.write("many.obj", many + "v 1 0 0\nv 0 1 0\nf 1 2 -1\nf 1 2 -2\n");
  string face = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf";
  for (int i = 0; i < 2000000; ++i) face += " 1 2 3";
  folder.write("face.obj", face + " 1\n");
  refused("many.obj", "<mesh> of link 'arm'", "has 500003 vertices");
  refused("face.obj", "face.obj: line 4", "more than 2000000 triangles");
  refused("folder.stl", "<mesh> of link 'arm'", "no regular file");
  refused("pipe.stl", "<mesh> of link 'arm'", "no regular file");
  refused("huge.stl", "<mesh> of link 'arm'", "larger than 64 MB");
  refused("flat.obj", "<mesh> of link 'arm'", "in a plane");
  refused("line.obj", "<mesh> of link 'arm'", "on a line");
  refused("three.obj", "<mesh> of link 'arm'", "3 points");
  refused("nan.obj", "nan.obj: line 2", "'nan' is not a finite number");
  if (fs::exists("/dev/zero"))
    expect_refused(
        [&] {
          fs::create_symlink("/dev/zero", folder / "zero.stl");
          return import_urdf_file(folder.write("r.urdf", urdf(mesh("zero.stl"))),
                                  {.colliders = true, .mesh_roots = {"/dev"}});
        },
        "<mesh>", "no regular file");
  folder.write("b.stl", as_binary_stl(block(1, 1, 1)));
  expect_refused(
      [&] {
        return import_urdf_file(folder.write("r.urdf", urdf(mesh("b.stl", "scale='1 0 1'"))), {.colliders = true});
      },
      "<mesh> of link 'arm'", "scale of 0");
}

// A link to a file of another name is of the format that its own name says.
TEST(UrdfMeshes, have_the_format_of_their_names) {
  const Folder folder;
  folder.write("blob/abc123", as_binary_stl(block(1, 1, 1)));
  fs::create_symlink(folder / "blob/abc123", folder / "a.stl");
  EXPECT_EQ(import_urdf_file(folder.write("r.urdf", urdf(mesh("a.stl"))), {.colliders = true}).model.colliders.size(),
            1u);
}

TEST(HostileMeshes, of_many_scales_are_bounded) {
  const Folder folder;
  folder.write("torus.stl", as_binary_stl(torus(.2, .05, 200, 100)));
  string collisions;
  for (int i = 1; i < 200; ++i) collisions += mesh("torus.stl", "scale='1 1 " + std::to_string(i) + "'");
  const ImportOptions coarse{.colliders = true, .hull_vertices = 8};
  expect_refused([&] { return import_urdf_file(folder.write("r.urdf", urdf(collisions)), coarse); }, "<mesh>",
                 "more than 2000000 vertices");
}

// One file at ten thousand places is read and made a hull once.
TEST(HostileMeshes, that_are_named_often_are_read_once) {
  const Folder folder;
  folder.write("torus.stl", as_binary_stl(torus(.2, .05, 100, 50)));
  string collisions;
  for (int i = 0; i < 10000; ++i) collisions += mesh("torus.stl");
  const clock_t start = clock();
  EXPECT_EQ(import_urdf_file(folder.write("r.urdf", urdf(collisions)), {.colliders = true}).model.colliders.size(),
            10000u);
  EXPECT_LT(static_cast<double>(clock() - start) / CLOCKS_PER_SEC, 60.0) << "of CPU time";
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
      "mesh 'u'", "outside of the folders", "mesh_roots");
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
  refused("<mesh name='u'" + points + "/><mesh name='u'" + points + "/>", geom, "<mesh>", "which is taken");
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
