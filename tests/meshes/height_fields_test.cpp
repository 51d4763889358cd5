// Height fields of MJCF files: numbers, images, MuJoCo's own format, and what is none of them.
// SPDX-License-Identifier: Apache-2.0
#include <png.h>
#include <zlib.h>

#include "lockstep/lockstep.h"
#include "mesh_models.h"
#include "meshes.h"
#include "unit/import_helpers.h"

namespace lockstep::meshes {
namespace {

using Eigen::MatrixXd;

string mjcf(const string& field, const string& compiler = "") {
  return "<mujoco><compiler " + compiler + "/><asset>" + field +
         "</asset><worldbody><geom name='ground' type='hfield' hfield='h' pos='0 0 1'/><body name='a' pos='0 0 3'>"
         "<freejoint/><geom size='.1'/></body></worldbody></mujoco>";
}

const string inline_field = "<hfield name='h' nrow='2' ncol='3' size='1 2 .5 .1' elevation='0 1 2 3 4 8'/>";

// What MuJoCo 3.14 makes of these numbers, times the height of 0.5: the last row lies at the least y.
MatrixXd expected() {
  MatrixXd heights(2, 3);
  heights << 0.375, 0.5, 1.0, 0.0, 0.125, 0.25;
  return 0.5 * heights;
}

const Shape& ground(const Import& import) {
  for (const Collider& collider : import.model.colliders)
    if (collider.name == "ground") return collider.shape;
  throw std::logic_error("no ground");
}

void expect_field(const Import& import) {
  const Shape& shape = ground(import);
  EXPECT_EQ(shape.kind, ShapeKind::height_field);
  EXPECT_EQ(shape.size, Eigen::Vector3d(2, 4, 0));
  ASSERT_EQ(shape.heights.rows(), 2);
  ASSERT_EQ(shape.heights.cols(), 3);
  EXPECT_LT((shape.heights - expected()).cwiseAbs().maxCoeff(), 1e-7);
  ASSERT_EQ(import.model.contacts.size(), 1u);
}

template <class Number>
string png_of(const std::vector<Number>& pixels, unsigned width, unsigned height, unsigned format) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION, image.width = width, image.height = height, image.format = format;
  png_alloc_size_t size = 0;
  png_image_write_to_memory(&image, nullptr, &size, 0, pixels.data(), 0, nullptr);
  string content(size, '\0');
  png_image_write_to_memory(&image, content.data(), &size, 0, pixels.data(), 0, nullptr);
  content.resize(size);
  return content;
}

// The same with a chunk gAMA of 0.5 behind the header, in place of one that it has.
string with_gamma(string png) {
  const string chunk("\0\0\0\4gAMA\0\0\xc3\x50", 12);
  const uLong sum = crc32(0, reinterpret_cast<const Bytef*>(chunk.data() + 4), 8);
  string whole = chunk;
  for (int shift = 24; shift >= 0; shift -= 8) whole += static_cast<char>(sum >> shift & 0xff);
  if (const std::size_t own = png.find("gAMA"); own != string::npos) png.erase(own - 4, 16);
  return png.insert(33, whole);
}

string grid_of(int rows, int columns, const std::vector<float>& numbers) {
  string content(8 + 4 * numbers.size(), '\0');
  const int counts[] = {rows, columns};
  std::memcpy(content.data(), counts, 8);
  if (!numbers.empty()) std::memcpy(content.data() + 8, numbers.data(), 4 * numbers.size());
  return content;
}

TEST(HeightFields, of_numbers_in_the_file_lie_as_in_mujoco) {
  expect_field(import_mjcf(mjcf(inline_field), "text", {.colliders = true}));
}

TEST(HeightFields, of_files_lie_as_numbers_in_the_same_order) {
  const Folder folder;
  folder.write("a/grey.png", png_of<std::uint8_t>({0, 30, 60, 90, 120, 240}, 3, 2, PNG_FORMAT_GRAY));
  const string deep = png_of<std::uint16_t>({0, 3000, 6000, 9000, 12000, 24000}, 3, 2, PNG_FORMAT_LINEAR_Y);
  folder.write("a/deep.png", deep);
  folder.write("a/grid.bin", grid_of(2, 3, {3, 4, 8, 0, 1, 2}));  // its first row has the least y
  // Pixels are numbers, whatever the file says of how bright they look.
  folder.write("a/gamma.png", with_gamma(png_of<std::uint8_t>({0, 30, 60, 90, 120, 240}, 3, 2, PNG_FORMAT_GRAY)));
  folder.write("a/deep_gamma.png", with_gamma(deep));
  for (const string file : {"grey.png", "deep.png", "gamma.png", "deep_gamma.png", "grid.bin"})
    expect_field(import_file(
        folder.write("r.xml", mjcf("<hfield name='h' size='1 2 .5 .1' file='" + file + "'/>", "assetdir='a'")),
        {.colliders = true}));
}

TEST(HeightFields, that_are_damaged_or_absent_are_named) {
  const Folder folder;
  const string whole = png_of<std::uint8_t>({0, 30, 60, 90, 120, 240}, 3, 2, PNG_FORMAT_GRAY);
  folder.write("cut.png", whole.substr(0, whole.size() - 20));
  folder.write("colour.png", png_of<std::uint8_t>(std::vector<std::uint8_t>(12, 9), 2, 2, PNG_FORMAT_RGB));
  folder.write("thin.png", png_of<std::uint8_t>({1, 2, 3}, 3, 1, PNG_FORMAT_GRAY));
  folder.write("short.bin", grid_of(2, 3, {1, 2, 3}));
  folder.write("huge.bin", grid_of(1 << 30, 1 << 30, {}));
  folder.write("text.bin", "hello");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  folder.write("nan.bin", grid_of(2, 2, {1, 2, nan, 3}));
  const auto refuse = [&](const string& field, const string& element, const string& rule, const string& remedy) {
    expect_refused([&] { return import_file(folder.write("r.xml", mjcf(field)), {.colliders = true}); }, element, rule,
                   remedy);
  };
  const auto of_file = [](const string& file) { return "<hfield name='h' size='1 2 .5 .1' file='" + file + "'/>"; };
  refuse(of_file("cut.png"), "cut.png", "damaged PNG", "save the image anew");
  refuse(of_file("colour.png"), "colour.png", "colours", "grey");
  refuse(of_file("thin.png"), "thin.png", "1 x 3", "2 x 2");
  refuse(of_file("short.bin"), "short.bin", "20 bytes", "PNG");
  refuse(of_file("huge.bin"), "huge.bin", "numbers", "2 x 2");
  refuse(of_file("text.bin"), "text.bin", "neither", "PNG");
  refuse(of_file("nan.bin"), "height field 'h'", "not finite", "numbers");
  refuse(of_file("none.png"), "height field 'h'", "does not exist", "correct the path");
  refuse("<hfield name='x' size='1 2 .5 .1' nrow='2' ncol='2' elevation='1 2 3 4'/>", "geom 'ground'",
         "height field 'h'", "correct the name");
  refuse("<hfield name='h' size='1 2 .5 .1' nrow='2' ncol='2' elevation='1 2 3'/>", "height field 'h'", "3 numbers",
         "give 4");
  refuse("<hfield name='h' size='1 2 0 .1' nrow='2' ncol='2' elevation='1 2 3 4'/>", "height field 'h'", "not above 0",
         "four numbers");
  refuse("<hfield name='h' size='1 2 1 .1' nrow='3000' ncol='3000' elevation='1'/>", "height field 'h'", "3000 x 3000",
         "2700000");
}

// One that a program fills in is left out, and a PNG that many geoms have is bounded.
TEST(HeightFields, without_numbers_are_left_out_and_many_are_refused) {
  const Import import =
      import_mjcf(mjcf("<hfield name='h' size='1 2 .5 .1' nrow='20' ncol='20'/>"), "text", {.colliders = true});
  EXPECT_EQ(import.model.colliders.size(), 1u);
  EXPECT_TRUE(warns(import, "hfield of ground"));
  const Folder folder;
  folder.write("h.png", png_of(std::vector<std::uint8_t>(1600 * 1600, 7), 1600, 1600, PNG_FORMAT_GRAY));
  string many;
  for (int i = 0; i < 8; ++i) many += "<geom type='hfield' hfield='h'/>";
  const string text = "<mujoco><asset><hfield name='h' size='1 2 .5 .1' file='h.png'/></asset><worldbody>" + many +
                      "<body name='a' pos='0 0 3'><freejoint/><geom size='.1'/></body></worldbody></mujoco>";
  expect_refused([&] { return import_file(folder.write("r.xml", text), {.colliders = true}); }, "geom",
                 "16000000 heights", "fewer geoms");
}

// A file that is not used is not opened.
TEST(HeightFields, that_no_geom_touches_with_are_not_opened) {
  const Import import =
      import_mjcf(mjcf("<hfield name='h' size='1 2 .5 .1' file='none.png'/>"), "text", {.colliders = false});
  EXPECT_TRUE(import.model.colliders.empty());
}

TEST(HeightFields, go_out_as_they_came_in) {
  const Import import = import_mjcf(mjcf(inline_field), "text", {.colliders = true});
  Model moved = import.model;
  for (Collider& collider : moved.colliders)
    if (collider.name == "ground") collider.shape.heights.array() -= 0.125;  // also heights below 0
  const Import again = import_mjcf(export_mjcf(moved).text, "text", {.colliders = true});
  for (const Collider& collider : again.model.colliders) {
    if (collider.name != "ground") continue;
    const Eigen::MatrixXd heights = collider.shape.heights.array() + collider.pose.translation().z();
    EXPECT_LT((heights.array() - 1.0 + 0.125 - expected().array()).abs().maxCoeff(), 1e-12);
  }
  EXPECT_EQ(ground(again).size, Eigen::Vector3d(2, 4, 0));
}

}  // namespace
}  // namespace lockstep::meshes
