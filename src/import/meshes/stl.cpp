// STL, a table of triangles. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <vector>

#include "formats.h"
#include "import/attributes.h"
#include "import/text.h"

namespace lockstep::importer {
namespace {

constexpr std::size_t header = 84, record = 50;  // bytes; a record begins with its normal

Eigen::Matrix3Xi in_threes(Eigen::Index vertices) {
  return Eigen::VectorXi::LinSpaced(vertices, 0, static_cast<int>(vertices) - 1).reshaped(3, vertices / 3);
}

Mesh read_binary(std::string_view content, std::size_t count, const FailAt& fail) {
  Eigen::Matrix3Xd vertices(3, static_cast<Eigen::Index>(3 * count));
  for (std::size_t triangle = 0; triangle < count; ++triangle) {
    float numbers[9];
    std::memcpy(numbers, content.data() + header + record * triangle + 3 * sizeof(float), sizeof(numbers));
    for (int i = 0; i < 9; ++i)
      vertices(i % 3, static_cast<Eigen::Index>(3 * triangle) + i / 3) = static_cast<double>(numbers[i]);
  }
  require_near(vertices, fail, [](Eigen::Index vertex) {
    return fmt::format("byte {}", header + record * static_cast<std::size_t>(vertex / 3) + 12);
  });
  return merged(vertices, in_threes(vertices.cols()));
}

Mesh read_text(std::string_view content, const FailAt& fail) {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<int> lines;     // by vertex
  int line = 0, of_face = 0;  // vertices since the face began
  const auto at = [&] { return fmt::format("line {}", line); };
  for (std::size_t begin = 0; begin < content.size();) {
    const std::size_t end = std::min(content.find('\n', begin), content.size());
    const std::string_view text = trimmed(content.substr(begin, end - begin));
    begin = end + 1, ++line;
    const std::size_t blank = std::min(text.find_first_of(" \t"), text.size());
    const std::string_view word = text.substr(0, blank);
    if (word == "vertex") {
      const Fail fail_here = [&](const std::string& rule, const std::string& remedy) { fail(at(), rule, remedy); };
      vertices.emplace_back();
      lines.push_back(line), ++of_face;
      numbers_in("vertex", trimmed(text.substr(blank)), vertices.back().data(), 3, 3, fail_here);
    } else if (word == "endloop") {
      if (of_face != 3) fail(at(), "ends a face that has not three vertices", "save the mesh as triangles");
      of_face = 0;
    } else if (!word.empty() && word != "solid" && word != "facet" && word != "outer" && word != "endfacet" &&
               word != "endsolid") {
      fail(at(), fmt::format("begins with '{}', which STL does not have", shortened(word)), "save the mesh anew");
    }
  }
  if (of_face != 0) fail(at(), "ends within a face", "save the mesh anew");
  const Eigen::Matrix3Xd table = Eigen::Map<const Eigen::Matrix3Xd>(vertices.empty() ? nullptr : vertices[0].data(), 3,
                                                                    static_cast<Eigen::Index>(vertices.size()));
  require_near(table, fail,
               [&](Eigen::Index vertex) { return fmt::format("line {}", lines[static_cast<std::size_t>(vertex)]); });
  return merged(table, in_threes(table.cols()));
}

}  // namespace

Mesh read_stl(std::string_view content, const FailAt& fail) {
  if (content.empty()) fail("byte 0", "is empty", "save the mesh anew");
  std::uint32_t count = 0;
  if (content.size() >= header) std::memcpy(&count, content.data() + 80, sizeof(count));
  // Some programs begin binary files with the word of text files, too, so the size decides.
  const bool is_binary = content.size() >= header && content.size() == header + record * std::size_t{count};
  const bool is_text = !is_binary && trimmed(content.substr(0, 100)).starts_with("solid");
  if (!is_binary && !is_text)
    fail(content.size() < header ? "byte 0" : "byte 80",
         fmt::format("has {} bytes, which is neither text nor the size of its {} triangles", content.size(), count),
         "save the mesh anew");
  if (count > most_triangles && is_binary)
    fail("byte 80", fmt::format("has {} triangles, more than {}", count, most_triangles), "simplify the mesh");
  const Mesh mesh = is_binary ? read_binary(content, count, fail) : read_text(content, fail);
  if (mesh.triangles.cols() == 0) fail("its end", "has no triangles", "save the mesh anew");
  return mesh;
}

}  // namespace lockstep::importer
