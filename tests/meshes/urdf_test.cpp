// Meshes of URDF files: where they lie, what becomes of them, and what is refused. SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>

#include <filesystem>

#include "lockstep/lockstep.h"
#include "mesh_models.h"
#include "meshes.h"
#include "unit/import_helpers.h"

namespace lockstep::meshes {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

// A link on a hinge, with the collision elements.
string urdf(const string& collisions, const string& inertial = unit_body) {
  return "<robot name='r'><link name='base'/><link name='arm'>" + inertial + collisions +
         "</link><joint name='j' type='continuous'><parent link='base'/><child link='arm'/></joint></robot>";
}
string mesh(const string& file, const string& more = "") {
  return "<collision><origin xyz='1 2 3'/><geometry><mesh filename='" + file + "' " + more +
         "/></geometry></collision>";
}

// The corners of one are those of the other, to the rounding of a file.
void expect_corners(const Collider& collider, const Eigen::Matrix3Xd& wanted) {
  const Eigen::Matrix3Xd own = placed(collider);
  ASSERT_EQ(own.cols(), wanted.cols());
  for (const auto& corner : wanted.colwise())
    EXPECT_LT((own.colwise() - corner).colwise().norm().minCoeff(), 1e-6) << corner.transpose();
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
  EXPECT_EQ(read("../meshes/a.stl", {.file_roots = {folder / "ws"}}).model.colliders.size(), 1u);
  EXPECT_EQ(
      read("file://" + (folder / "elsewhere/e.stl"), {.file_roots = {folder / "elsewhere"}}).model.colliders.size(),
      1u);
  EXPECT_EQ(read("package://arm_description/link.stl", {.file_roots = {folder / "elsewhere"}}).model.colliders.size(),
            1u);
  const auto refused = [&](const string& name, const string& rule, const string& remedy) {
    expect_refused([&] { return read(name); }, "r.urdf:1: <mesh> of link 'arm'", rule, remedy);
  };
  refused("../meshes/a.stl", "outside of the folders", "file_roots");
  refused("package://arm_description/../../elsewhere/e.stl", "outside of the folders", "file_roots");
  refused("package://arm_description/link.stl", "outside of the folders", "file_roots");
  refused(folder / "elsewhere/e.stl", "outside of the folders", "file_roots");
  refused("file://" + (folder / "elsewhere/e.stl"), "outside of the folders", "file_roots");
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
  const auto setting = [&](const ImportOptions& options, const string& element, const string& remedy = "") {
    expect_refused<SettingsError>([&] { return read("package://arm_description/meshes/a.stl", options); }, element, "",
                                  remedy);
  };
  setting({.packages = {{"p", folder / "none"}}}, "ImportOptions::packages");
  setting({.file_roots = {folder / "none"}}, "ImportOptions::file_roots");
  setting({.hull_vertices = 7}, "ImportOptions::hull_vertices");
  setting({.hull_vertices = 65}, "ImportOptions::hull_vertices");
  setting({.fit_of_links = {{"amr", Fit::box}}}, "ImportOptions::fit_of_links", "'arm' exists");
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

// A mirror turns all triangles inside out.
TEST(UrdfMeshes, weigh_in_a_mirror_what_they_weigh) {
  const Folder folder;
  folder.write("closed.obj", as_obj(u_mount()));
  const Import mirrored =
      import_urdf_file(folder.write("r.urdf", urdf(mesh("closed.obj", "scale='-1 1 2'"), "")), {.density = 1000.0});
  const Inertia& inertia = link(mirrored.model, "arm").inertia;
  EXPECT_NEAR(inertia.mass, 15.0, 1e-12);
  EXPECT_LT((inertia.center - Vector3d(0.85, 2.075, 3.18)).norm(), 1e-12);
  EXPECT_FALSE(warns(mirrored, "not closed"));
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
  refused("folder.stl", "<mesh> of link 'arm'", "is a folder");
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
                                  {.colliders = true, .file_roots = {"/dev"}});
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

// A mesh of many vertices whose hull is found at once: a box around a torus.
Mesh boxed_torus(int around, int across) {
  Mesh mesh = torus(.2, .05, around, across);
  const Mesh box = block(1, 1, 1);
  const Eigen::Index vertices = mesh.vertices.cols(), triangles = mesh.triangles.cols();
  mesh.vertices.conservativeResize(3, vertices + box.vertices.cols());
  mesh.vertices.rightCols(box.vertices.cols()) = box.vertices.array() - 0.5;
  mesh.triangles.conservativeResize(3, triangles + box.triangles.cols());
  mesh.triangles.rightCols(box.triangles.cols()) = box.triangles.array() + static_cast<int>(vertices);
  return mesh;
}

TEST(HostileMeshes, of_many_scales_are_bounded) {
  const Folder folder;
  folder.write("torus.stl", as_binary_stl(boxed_torus(200, 100)));
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
#ifdef LOCKSTEP_SANITIZED
  constexpr double most = 600.0;
#else
  constexpr double most = 60.0;
#endif
  const clock_t start = clock();
  EXPECT_EQ(import_urdf_file(folder.write("r.urdf", urdf(collisions)), {.colliders = true}).model.colliders.size(),
            10000u);
  EXPECT_LT(static_cast<double>(clock() - start) / CLOCKS_PER_SEC, most) << "of CPU time";
}

}  // namespace
}  // namespace lockstep::meshes
