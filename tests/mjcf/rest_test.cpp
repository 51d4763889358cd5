// What stands on soft feet stands where MuJoCo's stands. SPDX-License-Identifier: Apache-2.0
//
// MuJoCo's friction creeps until no foot is pushed sideways, so legs spread after they are set down. It does not with a
// large impratio, which leaves the normal forces of round cones as they are. So lockstep is compared with two motions:
// from the file's own keyframe with such a ratio, and from where MuJoCo rests after its creep.
#include <fstream>
#include <sstream>

#include "lockstep/import.h"
#include "mjcf/mujoco.h"

namespace lockstep {
namespace {

class MjcfRest : public MujocoTest {
 protected:
  // `deepest` is what MuJoCo's feet sink at least, m.
  void expect_rest(const std::filesystem::path& file, const std::string& key, double deepest) {
    compare(run(LOCKSTEP_MJCF "/rest.mjs", {file, key, "3", "1e4"}), file, key, deepest);
    compare(run(LOCKSTEP_MJCF "/rest.mjs", {file, key, "20"}), file, "rest", deepest);
  }

  std::filesystem::path written(const std::string& text) const {
    std::ofstream(work / "model.xml") << text;
    return work / "model.xml";
  }

  std::filesystem::path copied(const std::string& path) const {
    const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
    const std::filesystem::path file = std::filesystem::path(variable ? variable : LOCKSTEP_TEST_DATA) / path;
    if (!std::filesystem::exists(file)) return {};
    std::filesystem::copy(file.parent_path(), work, std::filesystem::copy_options::recursive);
    return work / file.filename();
  }

 private:
  void compare(const std::string& printed, const std::filesystem::path& file, const std::string& key, double deepest) {
    const nlohmann::json end = nlohmann::json::parse(printed);
    ASSERT_LT(end["speed"].get<double>(), 2e-3) << "it does not come to rest";
    const auto depths = end["depths"].get<std::vector<double>>();
    EXPECT_GT(*std::max_element(depths.begin(), depths.end()), deepest);

    const Import import = import_mjcf_file(file.parent_path() / "rest.xml", {.colliders = true, .keyframe = key});
    Batch<double> batch(compile(import.model, {.dt = 1.0 / 480.0}), 1);
    batch.step(4 * 480);
    const std::vector<std::string>& roots = batch.plan().root_names();
    const auto owners = end["owners"].get<std::vector<std::string>>();
    for (std::size_t r = 0; r < roots.size(); ++r) {
      const auto at = std::find(owners.begin(), owners.end(), roots[r]) - owners.begin() + 2;
      const double height = end["positions"][static_cast<std::size_t>(at)].get<double>();
      const double own = batch.root_poses()(static_cast<Eigen::Index>(7 * r + 2), 0);
      EXPECT_NEAR(own, height, 1e-3) << roots[r];
      std::printf("%s from the key %s rests %.2f mm %s than in MuJoCo\n", roots[r].c_str(), key.c_str(),
                  1e3 * std::abs(own - height), own > height ? "higher" : "lower");
    }
  }
};

TEST_F(MjcfRest, of_a_quadruped_is_that_of_mujoco) {
  std::ostringstream text;
  text << std::ifstream(LOCKSTEP_EXAMPLES "/quadruped.xml").rdbuf();
  std::string soft = text.str();
  const std::string foot = "<geom type=\"sphere\" size=\"0.02\"";
  ASSERT_NE(soft.find(foot), std::string::npos);
  soft.replace(soft.find(foot), foot.size(), foot + " priority=\"1\" solimp=\"0.015 1 0.031\"");
  expect_rest(written(soft), "stand", 0.008);
}

TEST_F(MjcfRest, of_a_published_quadruped_is_that_of_mujoco) {
  const std::filesystem::path file = copied("spot_menagerie/spot.xml");
  if (file.empty()) GTEST_SKIP() << "no spot_menagerie in LOCKSTEP_TEST_DATA";
  expect_rest(file, "home", 0.008);
}

}  // namespace
}  // namespace lockstep
