// OBJ, by tinyobjloader. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <sstream>
#include <vector>

#include "formats.h"
#include "import/attributes.h"
#include "import/text.h"

#define TINYOBJLOADER_USE_DOUBLE
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>

namespace lockstep::importer {
namespace {

// What the library calls for each line that it is given.
struct Builder {
  const FailAt& fail;
  std::vector<int> lines_of_vertices = {}, lines_of_faces = {};
  std::vector<double> coordinates = {};
  std::vector<int> corners = {};
  std::size_t faces = 0;

  void add_vertex(double x, double y, double z) { coordinates.insert(coordinates.end(), {x, y, z}); }

  void add_face(const tinyobj::index_t* indices, int count) {
    const std::string place = fmt::format("line {}", lines_of_faces[faces++]);
    const int known = static_cast<int>(coordinates.size() / 3);
    if (count < 3) fail(place, "is a face of fewer than three vertices", "save the mesh anew");
    std::vector<int> around;
    for (int i = 0; i < count; ++i) {
      const int index = indices[i].vertex_index;
      around.push_back(index < 0 ? known + index : index - 1);  // from the last one backwards, or from 1
      if (index == 0 || around.back() < 0 || around.back() >= known)
        fail(place, fmt::format("has the index {} of {} vertices before it", index, known), "save the mesh anew");
    }
    for (std::size_t i = 2; i < around.size(); ++i)
      corners.insert(corners.end(), {around[0], around[i - 1], around[i]});
  }
};

// A weight or a colour may follow.
std::string_view first_three(std::string_view text) {
  std::size_t end = 0;
  for (int word = 0; word < 3; ++word)
    end = std::min(text.find_first_of(" \t", std::min(text.find_first_not_of(" \t", end), text.size())), text.size());
  return text.substr(0, end);
}

std::size_t words_in(std::string_view text) {
  std::size_t words = 0;
  for (std::size_t i = 0; i < text.size(); ++i)
    words += text[i] != ' ' && text[i] != '\t' && (i == 0 || text[i - 1] == ' ' || text[i - 1] == '\t');
  return words;
}

// Digits, slashes and minus signs, and no number of more than nine digits.
bool has_indices(std::string_view face) {
  int digits = 0;
  for (const char c : face) {
    digits = c >= '0' && c <= '9' ? digits + 1 : 0;
    if (digits > 9 || (digits == 0 && c != '/' && c != '-' && c != ' ' && c != '\t')) return false;
  }
  return true;
}

// Lines of vertices and faces alone, with numbers. The library takes words without numbers for 0, and lets large ones
// overflow; other lines may ask it for any amount of memory.
std::string lines_for_library(std::string_view content, Builder& builder) {
  std::string kept;
  int line = 0;
  std::size_t indices = 0;
  if (content.starts_with("\xef\xbb\xbf")) content.remove_prefix(3);  // the mark of UTF-8
  for (std::size_t begin = 0; begin < content.size();) {
    const std::size_t end = std::min(content.find_first_of("\r\n", begin), content.size());
    const std::string_view text = trimmed(content.substr(begin, end - begin));
    const bool is_pair = end + 1 < content.size() && content[end] == '\r' && content[end + 1] == '\n';
    begin = end + (is_pair ? 2 : 1), ++line;
    const bool ends = text.size() == 1 || (text.size() > 1 && (text[1] == ' ' || text[1] == '\t'));
    if (!ends || (text[0] != 'v' && text[0] != 'f')) continue;
    const Fail fail = [&](const std::string& rule, const std::string& remedy) {
      builder.fail(fmt::format("line {}", line), rule, remedy);
    };
    double numbers[3];
    if (text[0] == 'v')
      numbers_in("v", first_three(trimmed(text.substr(1))), numbers, 3, 3, fail);
    else if (!has_indices(text.substr(1)))
      fail("has a word that is no index, among '" + shortened(text) + "'", "save the mesh anew");
    else if (const std::size_t words = words_in(text); words > 1)
      indices += words - 1;
    else
      fail("is a face that has no index", "save the mesh anew");
    if (indices > 3 * static_cast<std::size_t>(most_triangles))
      fail(fmt::format("makes the mesh have more than {} triangles", most_triangles), "simplify the mesh");
    (text[0] == 'v' ? builder.lines_of_vertices : builder.lines_of_faces).push_back(line);
    kept.append(text).push_back('\n');
  }
  return kept;
}

}  // namespace

Mesh read_obj(std::string_view content, const FailAt& fail) {
  Builder builder{fail};
  std::istringstream lines(lines_for_library(content, builder));
  tinyobj::callback_t calls;
  calls.vertex_cb = [](void* user, double x, double y, double z, double) {
    static_cast<Builder*>(user)->add_vertex(x, y, z);
  };
  calls.index_cb = [](void* user, tinyobj::index_t* indices, int count) {
    static_cast<Builder*>(user)->add_face(indices, count);
  };
  std::string warning, error;
  if (!tinyobj::LoadObjWithCallback(lines, calls, &builder, nullptr, &warning, &error))
    fail("its content", "is no OBJ: " + error.substr(0, error.find('\n')), "save the mesh anew");
  const Eigen::Matrix3Xd vertices = Eigen::Map<const Eigen::Matrix3Xd>(
      builder.coordinates.data(), 3, static_cast<Eigen::Index>(builder.coordinates.size() / 3));
  require_near(vertices, fail, [&](Eigen::Index vertex) {
    return fmt::format("line {}", builder.lines_of_vertices[static_cast<std::size_t>(vertex)]);
  });
  const Mesh mesh =
      merged(vertices, Eigen::Map<const Eigen::Matrix3Xi>(builder.corners.data(), 3,
                                                          static_cast<Eigen::Index>(builder.corners.size() / 3)));
  if (mesh.triangles.cols() == 0) fail("its end", "has no faces", "save the mesh anew");
  return mesh;
}

}  // namespace lockstep::importer
