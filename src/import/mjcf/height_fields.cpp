// SPDX-License-Identifier: Apache-2.0
#include "height_fields.h"

#include <fmt/format.h>

#include <filesystem>

#include "import/meshes/grids.h"
#include "lockstep/error.h"
#include "model/contact_pairs.h"

namespace lockstep::importer::mjcf {
namespace {

constexpr long most_heights_of_all = 16'000'000;

}  // namespace
std::optional<Shape> HeightFields::shape_of(const GeomPart& geom) {
  auto known = shapes_.find(geom.height_field);
  if (known == shapes_.end())
    known = shapes_.emplace(geom.height_field, read(assets_.find(geom, geom.height_field))).first;
  if (known->second) heights_ += known->second->heights.size();
  if (heights_ > most_heights_of_all)
    geom.element.fail(fmt::format("makes all height fields have more than {} heights", most_heights_of_all),
                      "make them smaller, or let fewer geoms have them");
  return known->second;
}

// Rows of the result go along y, from the least.
Eigen::MatrixXd HeightFields::numbers_of(const Element& element) const {
  std::string file = element.name("file", "");
  if (settings_.of(element).strips_paths) file = file.substr(file.find_last_of("/\\") + 1);
  if (!file.empty()) {
    const Fail fail = [&](const std::string& rule, const std::string& remedy) { element.fail(rule, remedy); };
    const std::filesystem::path path = files_.find(file, settings_.of(element).mesh_folder, fail);
    const FailAt fail_at = [&](const std::string& place, const std::string& rule, const std::string& remedy) {
      throw ImportError(path.string() + ": " + place, rule, remedy);
    };
    return read_grid(MeshFiles::content_of(path, "height field", fail), most_heights, fail_at);
  }
  const long rows = element.whole("nrow", 0), columns = element.whole("ncol", 0);
  if (rows < 2 || columns < 2 || rows * columns > most_heights)
    element.fail(fmt::format("has {} x {} heights", rows, columns),
                 fmt::format("give nrow and ncol of 2 and more, at most {} heights", most_heights));
  const std::vector<double> numbers = element.all_numbers("elevation", static_cast<std::size_t>(rows * columns));
  if (numbers.size() != static_cast<std::size_t>(rows * columns))
    element.fail(fmt::format("has {} numbers of elevation", numbers.size()), fmt::format("give {}", rows * columns));
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(numbers.data(), rows, columns).colwise().reverse();
}

// MuJoCo stretches the numbers to heights from 0 to size[2]. What is below 0, to -size[3], is solid here too.
std::optional<Shape> HeightFields::read(const Element& element) const {
  if (element.name("file", "").empty() && !element.has("elevation")) return std::nullopt;
  double size[4] = {};
  if (element.numbers("size", size, 4, 4) != 4) element.fail("has no size", "give four numbers in m");
  for (const double number : size)
    if (!(number > 0.0)) element.fail("has a size that is not above 0", "give four numbers in m");
  Eigen::MatrixXd heights = numbers_of(element);
  const double least = heights.minCoeff(), range = heights.maxCoeff() - least;
  if (!heights.allFinite() || !std::isfinite(range))
    element.fail("has a height that is not finite", "give numbers between -1e30 and 1e30");
  heights = ((heights.array() - least) * (range > 0.0 ? size[2] / range : 0.0)).matrix();
  return Shape::height_field(std::move(heights), 2.0 * size[0], 2.0 * size[1]);
}

}  // namespace lockstep::importer::mjcf
