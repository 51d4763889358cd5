// The page of which features stand beside which. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "combination_cells.h"
#include "combination_scenes.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using namespace combinations;

struct Table {
  std::string page;
  int by_default = 0, by_reduced = 0, in_leapfrog = 0;
};

Table table() {
  Table result;
  std::vector<std::string> obstacles;
  std::ostringstream rows;
  for (const std::vector<Feature>& features : all_scenes()) {
    const Scene scene(features);
    rows << "| " << (scene.name.empty() ? "nothing" : scene.name);
    const auto add = [&](Method method, Integrator integrator) {
      const Cell found = cell(scene.model, scene.settings, method, integrator);
      if (!found.obstacle.empty()) {
        auto place = std::find(obstacles.begin(), obstacles.end(), found.obstacle);
        if (place == obstacles.end()) place = obstacles.insert(place, found.obstacle);
        rows << " " << found.text << " (" << place - obstacles.begin() + 1 << ")";
        return false;
      }
      rows << " " << found.text;
      return true;
    };
    rows << " |";
    result.by_default += add(Method::automatic, Integrator::automatic);
    rows << " |";
    result.by_reduced += add(Method::reduced, Integrator::euler);
    rows << " |";
    result.in_leapfrog += add(Method::reduced, Integrator::leapfrog);
    rows << " |";
    add(Method::reduced, Integrator::extrapolated), add(Method::reduced, Integrator::runge_kutta);
    rows << " |";
    add(Method::direct, Integrator::euler), add(Method::direct, Integrator::leapfrog);
    rows << " |";
    add(Method::pgs, Integrator::euler), add(Method::tgs, Integrator::euler);
    rows << " |\n";
  }
  std::ostringstream page;
  page << "# Which features stand beside which\n\n"
          "T: tables, C: compiled, G: generated code, -: refused, for the numbered reason below. Of "
       << all_scenes().size() << " scenes, " << result.by_default << " run by default, " << result.by_reduced
       << " by `reduced` with `euler`, " << result.in_leapfrog
       << " by `reduced` with `leapfrog`.\n\n"
          "| scene | default | reduced, euler | reduced, leapfrog | reduced, extrapolated and runge_kutta | direct, "
          "euler "
          "and leapfrog | pgs and tgs, euler |\n"
          "| --- | --- | --- | --- | --- | --- | --- |\n"
       << rows.str() << "\n";
  for (std::size_t i = 0; i < obstacles.size(); ++i) page << i + 1 << ". " << obstacles[i] << "\n";
  page << "\n`LOCKSTEP_WRITE_PAGES=1 ctest --preset release -R CombinationsPage` writes this page.\n";
  result.page = page.str();
  return result;
}

// What compile() refuses of a scene by its method or integrator, the plan by default lists, in the same words; and
// what it lists, compile() refuses.
TEST(Combinations, that_are_refused_are_obstacles_of_the_plan_by_default) {
  constexpr Integrator staged[] = {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta};
  std::vector<std::pair<Method, Integrator>> ways{{Method::pgs, Integrator::euler},
                                                  {Method::tgs, Integrator::euler},
                                                  {Method::direct, Integrator::euler},
                                                  {Method::direct, Integrator::leapfrog}};
  for (const Integrator integrator : staged) ways.push_back({Method::reduced, integrator});
  int refused = 0, listed = 0;
  for (const std::vector<Feature>& features : all_scenes()) {
    const auto [model, settings, name] = Scene(features);
    const Plan plan = compile(model, settings);
    const std::vector<Obstacle> obstacles = plan.obstacles();
    for (const auto& [method, integrator] : ways) {
      StepSettings asked = settings;
      asked.method = method, asked.integrator = integrator;
      try {
        compile(model, asked);
      } catch (const SettingsError& error) {
        const std::string what = error.element() == "method" ? to_string(method) : to_string(integrator);
        EXPECT_TRUE(std::any_of(obstacles.begin(), obstacles.end(),
                                [&](const Obstacle& o) {
                                  return o.applies_to == what && error.rule().ends_with(o.reason) &&
                                         error.remedy() == o.remedy && !o.feature.empty();
                                }))
            << name << ": " << error.what();
        ++refused;
      }
    }
    for (const Obstacle& obstacle : obstacles) {
      for (const Method method : {Method::pgs, Method::tgs, Method::direct, Method::reduced})
        if (obstacle.applies_to == to_string(method)) {
          EXPECT_EQ(cell(model, settings, method, Integrator::automatic).text, "-") << name << ": " << obstacle.reason;
          ++listed;
        }
      for (const Integrator integrator : staged)
        if (obstacle.applies_to == to_string(integrator)) {
          EXPECT_EQ(cell(model, settings, plan.method(), integrator).text, "-") << name << ": " << obstacle.reason;
          ++listed;
        }
    }
  }
  EXPECT_GT(refused, 150);
  EXPECT_GT(listed, 150);
}

TEST(CombinationsPage, is_what_compile_says) {
  const Table found = table();
  const std::string path = LOCKSTEP_MODELS "/../../docs/results/combinations.md";
  if (std::getenv("LOCKSTEP_WRITE_PAGES")) std::ofstream(path) << found.page;
  std::ostringstream committed;
  committed << std::ifstream(path).rdbuf();
  EXPECT_EQ(committed.str(), found.page);
}

}  // namespace
}  // namespace lockstep
