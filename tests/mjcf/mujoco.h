// MuJoCo as an oracle of tests. SPDX-License-Identifier: Apache-2.0
//
// Needs node, and LOCKSTEP_MUJOCO_JS, the folder that `npm install mujoco-js@0.0.7` (MuJoCo 3.3.8) has filled:
// .../node_modules/mujoco-js.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "lockstep/plan.h"

namespace lockstep {

class MujocoTest : public testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("LOCKSTEP_MUJOCO_JS");
    if (!folder || !std::filesystem::exists(folder)) GTEST_SKIP() << "LOCKSTEP_MUJOCO_JS names no folder";
    library_ = folder;
    const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(test.test_suite_name()) + "_" + test.name();
    std::replace(name.begin(), name.end(), '/', '_');
    work = std::filesystem::path(testing::TempDir()) / name;
    std::filesystem::remove_all(work);
    std::filesystem::create_directories(work);
  }

  /// What a script of this project prints.
  std::string run(const std::string& script, std::initializer_list<std::string> arguments) const {
    std::string command = "node", text;
    for (const std::string& word : {script, library_}) command += " '" + word + "'";
    for (const std::string& word : arguments) command += " '" + word + "'";
    FILE* pipe = popen(command.c_str(), "r");
    char piece[4096];
    while (const std::size_t count = std::fread(piece, 1, sizeof piece, pipe)) text.append(piece, count);
    EXPECT_EQ(pclose(pipe), 0) << command;
    return text;
  }

  std::filesystem::path work;  ///< empty

 private:
  std::string library_;
};

struct Deviation {
  double difference = 0.0;  ///< the largest of a position, rad or m; of orientations half the angle between them
  double travel = 0.0;      ///< the largest of a joint from its start
};

/// Steps a batch along with the motion that play() of mujoco.mjs has printed.
inline Deviation follow(Batch<double>& batch, const std::string& motion) {
  const Plan& plan = batch.plan();
  const nlohmann::json read = nlohmann::json::parse(motion);
  const auto owners = read["owners"].get<std::vector<std::string>>();
  const std::vector<std::string>&dofs = plan.dof_names(), &roots = plan.root_names();
  const int steps = static_cast<int>(std::round(0.01 / plan.settings().dt));
  Deviation result;
  const auto add = [&](double difference) {
    result.difference = std::max(result.difference, std::isnan(difference) ? infinity : difference);
  };
  std::vector<double> first;
  for (const auto& row : read["rows"].get<std::vector<std::vector<double>>>()) {
    if (first.empty())
      first = row;
    else
      batch.step(steps);
    for (std::size_t i = 0; i < owners.size(); ++i) {
      const auto dof = std::find(dofs.begin(), dofs.end(), owners[i]);
      const auto root = std::find(roots.begin(), roots.end(), owners[i]);
      if (dof != dofs.end()) {
        add(std::abs(row[i] - batch.positions()(dof - dofs.begin(), 0)));
        result.travel = std::max(result.travel, std::abs(row[i] - first[i]));
      } else if (root != roots.end()) {
        const Eigen::Matrix<double, 7, 1> own = batch.root_poses().col(0).segment<7>(7 * (root - roots.begin()));
        const Eigen::Map<const Eigen::Matrix<double, 7, 1>> theirs(&row[i]);
        add((own - theirs).head<3>().cwiseAbs().maxCoeff());
        add(std::min((own - theirs).tail<4>().norm(), (own + theirs).tail<4>().norm()));
        i += 6;
      } else {
        const Model& model = plan.model();  // what an equality holds
        EXPECT_FALSE(model.joints[static_cast<std::size_t>(model.joint_index(owners[i]))].moves()) << owners[i];
      }
    }
  }
  return result;
}

}  // namespace lockstep
