// The same mesh from all formats. SPDX-License-Identifier: Apache-2.0
#include "import/meshes/formats.h"

#include "import/meshes/inertia.h"
#include "meshes.h"

namespace lockstep::meshes {
namespace {

using std::string;

using Reader = Mesh (*)(std::string_view, const importer::FailAt&);

struct Refused {
  string place, rule;
};

const importer::FailAt refuse = [](const string& place, const string& rule, const string&) {
  throw Refused{place, rule};
};

Mesh rounded(Mesh mesh) {
  mesh.vertices = mesh.vertices.cast<float>().cast<double>().eval();
  return mesh;
}

// Corners of triangles in their order, wherever the vertices stand.
Eigen::MatrixXd corners(const Mesh& mesh) { return mesh.vertices(Eigen::all, mesh.triangles.reshaped()); }

TEST(Formats, read_the_same_mesh) {
  const Mesh mesh = u_mount();
  struct Case {
    Reader read;
    string content;
    bool is_precise;
  };
  const Case cases[] = {{importer::read_stl, as_binary_stl(mesh), false},
                        {importer::read_stl, as_text_stl(mesh), true},
                        {importer::read_stl, as_binary_stl(mesh, "solid but binary"), false},
                        {importer::read_obj, as_obj(mesh), true},
                        {importer::read_msh, as_msh(mesh), false}};
  for (const auto& [read, content, precise] : cases) {
    const Mesh again = read(content, refuse);
    EXPECT_EQ(again.vertices.cols(), 16);
    ASSERT_EQ(again.triangles.cols(), mesh.triangles.cols());
    EXPECT_LT((corners(again) - corners(precise ? mesh : rounded(mesh))).cwiseAbs().maxCoeff(), 1e-15);
    EXPECT_TRUE(importer::is_closed(again));
  }
  EXPECT_EQ(importer::read_msh(as_msh(mesh, false), refuse).triangles.cols(), 0);
}

TEST(Formats, of_obj_may_have_faces_of_many_vertices_and_vertices_with_colours) {
  const Mesh mesh = importer::read_obj(
      "\xef\xbb\xbfv 0 0 0 1 0 0\nv 1 0 0 nan nan nan\nv 1 1 0 .5 .5 .5\n v\t0 1 0 1\nf 1 2 3 4\nv 0 0 1\nf -1 -4 -5\n",
      refuse);
  ASSERT_EQ(mesh.triangles.cols(), 3);
  EXPECT_EQ(corners(mesh).rightCols(3), (Eigen::Matrix3d() << 0, 1, 0, 0, 0, 0, 1, 0, 0).finished());
  EXPECT_EQ(corners(mesh).middleCols(3, 3), (Eigen::Matrix3d() << 0, 1, 0, 0, 1, 1, 0, 0, 0).finished());
}

// Each is refused at a place, with no more memory than the file has.
TEST(Formats, refuse_what_is_damaged) {
  const Mesh mesh = block(1, 1, 1);
  const string stl = as_binary_stl(mesh), msh = as_msh(mesh), text = as_text_stl(mesh);
  const auto changed = [](string bytes, std::size_t at, const auto& number) {
    std::memcpy(bytes.data() + at, &number, sizeof(number));
    return bytes;
  };
  struct Case {
    Reader read;
    string content, place, rule;
  };
  const Case cases[] = {
      {importer::read_stl, "", "byte 0", "is empty"},
      {importer::read_stl, "abc", "byte 0", "has 3 bytes, which is neither text"},
      {importer::read_stl, stl.substr(0, 683), "byte 80",
       "has 683 bytes, which is neither text nor the size of its 12"},
      {importer::read_stl, stl + "x", "byte 80", "neither text"},
      {importer::read_stl, changed(stl, 80, std::uint32_t{0xffffffff}), "byte 80", "of its 4294967295 triangles"},
      {importer::read_stl, changed(stl, 96 + 50, NAN), "byte 146", "not finite"},
      {importer::read_stl, changed(stl, 96, 2e6f), "byte 96", "beyond a million"},
      {importer::read_stl, string(80, ' ') + string(4, '\0'), "its end", "no triangles"},
      {importer::read_stl, "solid\nendsolid\n", "its end", "no triangles"},
      {importer::read_stl, "solid\nfacet normal 0 0 0\nvertex 0 0 x\n", "line 3", "'x' is not a finite number"},
      {importer::read_stl, "solid\nvertex 0 0 0\nendloop\n", "line 3", "not three vertices"},
      {importer::read_stl, "solid\nvertex 0 0 0\n", "line 2", "ends within a face"},
      {importer::read_stl, "solid\nvertices 0 0 0\n", "line 2", "'vertices'"},
      {importer::read_stl, "solid\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nvertex 1 1 0\nendloop\n", "line 6",
       "not three"},
      {importer::read_stl, text.substr(0, 60) + "\xff\xfe\n", "line 4", "begins with '\\xff\\xfe'"},
      {importer::read_obj, "", "its end", "no faces"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "its end", "no faces"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4", "index 4 of 3"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 0 3\n", "line 5", "index 0 of 3"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", "line 4", "index -4 of 3"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", "line 4", "no index"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4294967297\n", "line 4", "no index"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3x\n", "line 4", "no index"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nf 1 2\n", "line 3", "fewer than three"},
      {importer::read_obj, "v 0 0\nf 1 1 1\n", "line 1", "has 2 numbers"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf\n", "line 4", "has no index"},
      {importer::read_obj, "v\nf 1 1 1\n", "line 1", "has 0 numbers"},
      {importer::read_obj, "v 0 0 nan\n", "line 1", "not a finite number"},
      {importer::read_obj, "v 0 0 1e7\nf 1 1 1\n", "line 1", "beyond a million"},
      {importer::read_obj, string("v 0 0 0\0\n", 9), "line 1", "not a finite number"},
      {importer::read_obj, "v 0 0 0\nv 1 0 0\nf 1 2 1\nf 1 1 1\n", "its end", "no faces"},
      {importer::read_msh, "abc", "byte 0", "shorter than the header"},
      {importer::read_msh, "$MeshFormat\n2.2 0 8\n", "byte 0", "Gmsh"},
      {importer::read_msh, msh.substr(0, 100), "byte 0", "has 100 bytes, but counts"},
      {importer::read_msh, changed(msh, 0, std::int32_t{-1}), "byte 0", "has the count -1"},
      {importer::read_msh, changed(msh, 12, std::int32_t{2000000000}), "byte 0", "has the count 2000000000"},
      {importer::read_msh, changed(msh, msh.size() - 4, std::int32_t{8}), "byte", "index of none of its 8"},
      {importer::read_msh, changed(msh, msh.size() - 4, std::int32_t{-1}), "byte", "index of none of its 8"},
      {importer::read_msh, changed(msh, 16, INFINITY), "byte 16", "not finite"},
  };
  for (const Case& one : cases) {
    try {
      one.read(one.content, refuse);
      ADD_FAILURE() << "read: " << one.rule;
    } catch (const Refused& refused) {
      EXPECT_TRUE(refused.place.starts_with(one.place))
          << refused.place << ", not " << one.place << ": " << refused.rule;
      EXPECT_NE(refused.rule.find(one.rule), string::npos) << refused.rule << ", not " << one.rule;
    }
  }
}

// Bytes changed, cut off and doubled at random: read or refused, and no vertex of a triangle is missing.
TEST(Formats, survive_random_damage) {
  const Mesh mesh = u_mount();
  std::uint64_t state = 1;
  const auto below = [&](std::size_t count) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<std::size_t>((state >> 33) % count);
  };
  int read = 0, refused = 0;
  const std::pair<Reader, string> wholes[] = {{importer::read_stl, as_binary_stl(mesh)},
                                              {importer::read_stl, as_text_stl(mesh)},
                                              {importer::read_obj, as_obj(mesh)},
                                              {importer::read_msh, as_msh(mesh)}};
  for (const auto& [reader, whole] : wholes)
    for (int i = 0; i < 3000; ++i) {
      string content = whole;
      for (std::size_t change = below(4) + 1; change > 0; --change) {
        const std::size_t at = below(content.size());
        if (const std::size_t kind = below(8); kind == 0)
          content.resize(std::max<std::size_t>(at, 1));
        else if (kind == 1)
          content.insert(at, content.substr(at, below(40)));
        else
          content[at] = static_cast<char>(kind < 5 ? below(256) : "0123456789-. \nef/"[below(17)]);
      }
      try {
        const Mesh damaged = reader(content, refuse);
        for (const int corner : damaged.triangles.reshaped()) {
          ASSERT_GE(corner, 0);
          ASSERT_LT(corner, damaged.vertices.cols());
        }
        ASSERT_TRUE(damaged.vertices.allFinite());
        ++read;
      } catch (const Refused&) {
        ++refused;
      }
    }
  EXPECT_GT(read, 1000);
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace lockstep::meshes
