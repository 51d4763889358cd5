// Robot descriptions of other projects, from the folder LOCKSTEP_TEST_DATA. SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <fstream>

#include "import_helpers.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using std::string;

struct Robot {
  const char* file;
  int moving, couplings;
  const char* refused;  // the link that the ModelError names, or null if the file is read
  const char* line;     // of the report, after every link is given a body
};

void PrintTo(const Robot& robot, std::ostream* stream) { *stream << robot.file; }

class Robots : public testing::TestWithParam<Robot> {
 protected:
  void SetUp() override {
    const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
    const string folder = variable ? variable : LOCKSTEP_TEST_DATA;
    if (folder.empty()) GTEST_SKIP() << "LOCKSTEP_TEST_DATA names no folder";
    path = folder + "/robots/" + GetParam().file;
  }

  static void expect_counts(const Model& model) {
    const auto moves = [](const Joint& candidate) { return candidate.moves(); };
    EXPECT_EQ(std::count_if(model.joints.begin(), model.joints.end(), moves), GetParam().moving);
    EXPECT_EQ(static_cast<int>(model.couplings.size()), GetParam().couplings);
    for (const Coupling& coupling : model.couplings) EXPECT_EQ(error_at_start(model, coupling), 0.0) << coupling.joint;
  }

  string path;
};

TEST_P(Robots, are_read_or_refused_as_expected) {
  if (!GetParam().refused) return expect_counts(import_urdf_file(path).model);
  try {
    import_urdf_file(path);
    FAIL() << "accepted";
  } catch (const ModelError& error) {
    EXPECT_TRUE(error.element().starts_with(path + ":")) << error.what();
    EXPECT_TRUE(error.element().ends_with(GetParam().refused)) << error.what();
    EXPECT_NE(error.rule().find("inertia is"), string::npos) << error.what();
  }
}

// Gives every <link> the same body.
string with_bodies(string text) {
  for (std::size_t at; (at = text.find("<inertial")) != string::npos;)
    text.erase(at, text.find("</inertial>") + 11 - at);
  for (std::size_t at = 0; (at = text.find("<link name", at)) != string::npos;) {
    at = text.find('>', at);
    const bool is_closed = text[at - 1] == '/';
    if (is_closed) text.erase(--at, 1);
    text.insert(at + 1, is_closed ? unit_body + "</link>" : unit_body);
  }
  return text;
}

TEST_P(Robots, have_their_couplings_if_all_links_have_bodies) {
  std::ifstream stream(path);
  const Import import = import_urdf(with_bodies({std::istreambuf_iterator<char>(stream), {}}), path);
  expect_counts(import.model);
  expect_reports(import, GetParam().line);
}

TEST_P(Robots, are_read_with_least_masses_and_inertias) {
  const Import import = import_urdf_file(path, {.least_mass = 0.01, .least_inertia = 1e-5});
  expect_counts(import.model);
}

INSTANTIATE_TEST_SUITE_P(
    data, Robots,
    testing::Values(
        Robot{"robotiq_2f_85.urdf", 6, 5, "link 'left_outer_knuckle'",
              "followers that leave their limits while their leader keeps its own (2): "
              "left_inner_finger_joint by 0.8 rad, right_inner_finger_joint by 0.8 rad"},
        Robot{"panda.urdf", 9, 1, "link 'panda_link1'", "read 12 links, 9 moving joints, 1 coupling"},
        Robot{"dvrk_tip_093.urdf", 4, 3, "link 'jaw_axis_link'",
              "followers that start where their coupling puts them (1): jaw_axis at 0.0077"},
        Robot{"inspire_ftp_left.urdf", 12, 6, nullptr,
              "chains of mimics resolved (1): left_thumb_4_joint <- left_thumb_3_joint <- left_thumb_2_joint is "
              "0.761237 left_thumb_2_joint + 0"},
        Robot{"hsrb4s.urdf", 26, 7, nullptr,
              "followers that leave their limits while their leader keeps its own (2): "
              "hand_l_distal_joint by 0.087 rad, hand_r_distal_joint by 0.087 rad"},
        Robot{"romeo.urdf", 55, 22, "link 'RShoulderYawLink'", "read 82 links, 55 moving joints, 22 couplings"}),
    [](const auto& robot) {
      const string file = robot.param.file;
      return file.substr(0, file.find('.'));
    });

}  // namespace
}  // namespace lockstep
