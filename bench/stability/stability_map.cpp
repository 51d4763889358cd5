// Maps of where each method is stable, and how it fails: one CSV file each. SPDX-License-Identifier: Apache-2.0
//
// docs/stability.md describes the maps, and stability_map.py draws them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "judgement.h"
#include "tool/csv.h"
#include "tool/output.h"
#include "tool/progress.h"
#include "tool/rank.h"

namespace lockstep::stability {
namespace {

struct Point {
  double x, y;
};

// The points of the map, grouped into those that one Batch can step.
std::vector<std::vector<Point>> batches(const Map& map, Method method) {
  const bool once = map.sweeps() && (method == Method::direct || method == Method::reduced);
  const std::vector<double> xs = once ? std::vector<double>{0} : map.x.values;
  std::vector<std::vector<Point>> result;
  for (std::size_t i = 0; i < xs.size(); ++i)
    for (std::size_t k = 0; k < map.y.values.size(); ++k) {
      const bool starts_row = k == 0 && !map.x.in_environments;
      if (result.empty() || starts_row || !map.y.in_environments) result.emplace_back();
      result.back().push_back({xs[i], map.y.values[k]});
    }
  return result;
}

// The share of the rank. Only rank 0 writes the line of names, so the files of all ranks, one behind the other, are
// one.
void run(const Map& map, const std::filesystem::path& folder, const Rank& rank) {
  constexpr Method methods[] = {Method::pgs, Method::tgs, Method::direct, Method::reduced};
  std::int64_t total = 0, place = 0;
  for (const Method method : methods) total += static_cast<std::int64_t>(batches(map, method).size());
  const IdRange own = ids_of(rank, total);
  double done = 0.0;
  fmt::print(stderr, "{}\n", map.name);
  tool::Progress progress(own.count, "batches");
  tool::OutputFile file((folder / (map.name + ".csv")).string());
  if (rank.rank == 0) file.write(fmt::format("{},{},method,class,error,energy_excess,fault\n", map.x.name, map.y.name));
  for (const Method method : methods)
    for (const std::vector<Point>& points : batches(map, method)) {
      if (const std::int64_t its = place++ - own.first; its < 0 || its >= own.count) continue;
      std::vector<Setup> setups;
      for (const Point& point : points) setups.push_back(map.at(point.x, point.y));
      const std::vector<Verdict> verdicts = judge(map, method, setups);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Verdict& verdict = verdicts[i];
        file.write(fmt::format("{:.4g},{:.4g},{},{},{:.2g},{:.2g},{}\n", points[i].x, points[i].y, to_string(method),
                               to_string(verdict.kind), verdict.error, verdict.excess,
                               verdict.fault == Fault::none ? "" : to_string(verdict.fault)));
      }
      progress.update(++done);
    }
  file.close();
}

}  // namespace
}  // namespace lockstep::stability

int main(int argc, char** argv) {
  using namespace lockstep::stability;
  CLI::App app("Maps where each method is stable or accurate, and how it fails.", "stability_map");
  std::string folder;
  lockstep::tool::RankOption rank;
  std::vector<std::string> names, known;
  bool quick = false;
  for (const Map& map : all_maps(false)) known.push_back(map.name);
  app.add_option("--out", folder, "Folder for the CSV files")->required();
  app.add_option("--maps", names, "Writes these maps alone")->delimiter(',')->check(CLI::IsMember(known));
  app.add_flag("--quick", quick, "Takes a coarse grid");
  lockstep::tool::add_rank(app, rank, "Makes the share of each map that rank R of N has");
  try {
    app.parse(argc, argv);
    folder = lockstep::tool::name_of_rank("--out", folder, rank);
    std::filesystem::create_directories(folder);
    for (const Map& map : all_maps(quick))
      if (names.empty() || std::count(names.begin(), names.end(), map.name) > 0) run(map, folder, rank);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    fmt::print(stderr, "stability_map: rank {} of {}: {}\n", rank.rank, rank.ranks, error.what());
    return 1;
  }
}
