// lockstep view: what stands in the page. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "command.h"
#include "tool/options.h"
#include "tool/replay.h"
#include "tool/state.h"
#include "tool/tool.h"
#include "view/page.h"

namespace lockstep::tool {
namespace {

using namespace view;

Plan plan_of(const std::string& file, const char* ground = nullptr) {
  ModelOptions options;
  options.file = file;
  options.import.colliders = true;
  if (ground) options.ground = std::stod(ground);
  return compile(options.load({}).model);
}

const std::string arm_gripper = std::string(LOCKSTEP_MODELS) + "/arm_gripper.urdf";

std::string text_of(const std::string& bytes) {
  return base64({reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()});
}

// The vectors of RFC 4648, section 10.
TEST(Page, base64_is_that_of_the_rfc) {
  EXPECT_EQ(text_of(""), "");
  EXPECT_EQ(text_of("f"), "Zg==");
  EXPECT_EQ(text_of("fo"), "Zm8=");
  EXPECT_EQ(text_of("foo"), "Zm9v");
  EXPECT_EQ(text_of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(text_of("\xfb\xff"), "+/8=");
}

std::vector<unsigned char> decoded(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<unsigned char> bytes;
  unsigned bits = 0, count = 0;
  for (const char digit : text) {
    if (digit == '=') break;
    bits = bits << 6 | static_cast<unsigned>(digits.find(digit)), count += 6;
    if (count >= 8) bytes.push_back(bits >> (count -= 8) & 255);
  }
  return bytes;
}

// A solid of uniform density about its centre, from the textbook.
Eigen::Matrix3d tensor_of(const Solid& solid, double mass) {
  Eigen::Vector3d moments;
  if (solid.shape.kind == ShapeKind::cylinder) {
    const double r = solid.shape.size[0], l = solid.shape.size[1], across = mass * (3 * r * r + l * l) / 12;
    moments = {across, across, mass * r * r / 2};
  } else {
    const Eigen::Vector3d s = solid.shape.size.cwiseAbs2();
    moments = mass / 12 * Eigen::Vector3d(s[1] + s[2], s[2] + s[0], s[0] + s[1]);
  }
  const Eigen::Matrix3d turn = solid.pose.linear();
  return turn * moments.asDiagonal() * turn.transpose();
}

TEST(Solids, have_the_inertia_that_they_stand_for) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.01, 0.2);
  for (int trial = 0; trial < 200; ++trial) {
    const bool round = trial % 2 == 1;
    const Eigen::Vector3d size(uniform(random), uniform(random), uniform(random));
    Solid given{round ? Shape::cylinder(size[0], size[1]) : Shape::box(size), Pose::Identity()};
    given.pose.linear() = Eigen::Quaterniond::UnitRandom().toRotationMatrix();
    const double mass = 10 * uniform(random);
    const Eigen::Vector3d center(uniform(random), uniform(random), uniform(random));
    const Inertia inertia{mass, center, tensor_of(given, mass)};
    const std::optional<Solid> solid = solid_of(inertia);
    ASSERT_TRUE(solid);
    EXPECT_TRUE(solid->from_inertia);
    EXPECT_TRUE((tensor_of(*solid, mass) - inertia.about_center).norm() < 1e-9 * inertia.about_center.norm()) << trial;
    EXPECT_EQ(solid->pose.translation(), center);
    EXPECT_NEAR(solid->pose.linear().determinant(), 1.0, 1e-12);
    if (round) {
      EXPECT_NEAR(solid->shape.size[0], given.shape.size[0], 1e-9) << trial;
    }
  }
}

TEST(Solids, exist_for_every_mass_and_for_nothing_else) {
  EXPECT_FALSE(solid_of({}));
  const std::optional<Solid> point = solid_of({.mass = 1.0});
  ASSERT_TRUE(point);
  EXPECT_EQ(point->shape.kind, ShapeKind::sphere);
  EXPECT_NEAR(4.0 / 3.0 * std::numbers::pi * std::pow(point->shape.size[0], 3) * 1000.0, 1.0, 1e-12);
  Inertia rod{.mass = 1.0};
  rod.about_center.diagonal() << 0.01, 0.01, 0.0;
  EXPECT_GT(solid_of(rod)->shape.size[0], 0.0);
}

// 8 kg of water are a cube of 0.2 m.
TEST(Solids, of_inertias_are_made_small) {
  const auto longest = [](const Solid& given, double mass) {
    const Solid solid = made_small(given, mass);
    EXPECT_EQ(solid.pose.translation(), given.pose.translation());
    EXPECT_NEAR(solid.shape.size[1] / solid.shape.size[0], given.shape.size[1] / given.shape.size[0], 1e-12);
    return solid.shape.kind == ShapeKind::cylinder ? std::max(2 * solid.shape.size[0], solid.shape.size[1])
                                                   : solid.shape.size.maxCoeff();
  };
  const Pose pose(Eigen::Translation3d(1, 2, 3));
  EXPECT_NEAR(longest({Shape::box({1.0, 0.5, 0.01}), pose}, 8.0), 0.4, 1e-12);
  EXPECT_NEAR(longest({Shape::cylinder(0.5, 0.1), pose}, 8.0), 0.4, 1e-12);
  EXPECT_NEAR(longest({Shape::cylinder(0.1, 0.3), pose}, 8.0), 0.3, 1e-12);  // small as it is
  for (const DrawnLink& drawn : drawn_links(plan_of(std::string(LOCKSTEP_MODELS) + "/gripper.urdf")))
    for (const Solid& solid : drawn.solids)
      if (solid.from_inertia) {
        EXPECT_LT(solid.shape.size.maxCoeff(), 0.25);
      }
}

TEST(Solids, have_the_role_of_what_moves_them) {
  const Plan plan = plan_of(arm_gripper);
  std::map<std::string, Role> roles;
  for (const DrawnLink& drawn : drawn_links(plan)) roles[plan.model().links[drawn.link].name] = drawn.role;
  EXPECT_EQ(roles.count("world"), 0u);
  EXPECT_EQ(roles.at("base"), Role::base);
  EXPECT_EQ(roles.at("palm"), Role::driver);  // fixed to the flange
  EXPECT_EQ(roles.at("left_knuckle"), Role::driver);
  EXPECT_EQ(roles.at("left_tip"), Role::follower);
  EXPECT_EQ(roles.at("box"), Role::free);
}

// Every sample of a motion that touches things is what the library reads at that state.
TEST(Motion, holds_the_readbacks_of_the_batch) {
  const Plan plan = plan_of(arm_gripper, "0.9");
  Batch<float> batch(plan, 3, {.threads = 1});
  perturb(0.05, 1, batch);
  Motion motion(plan, true, {"a", "b"});
  const std::size_t links = motion.links.size(), pairs = plan.contacts().size();
  for (int sample = 0; sample < 4; ++sample) {
    motion.add(0.1 * sample, batch, {2, 0});
    for (int track = 0; track < 2; ++track) {
      const int e = track == 0 ? 2 : 0;
      const Track& shown = motion.tracks[track];
      for (std::size_t i = 0; i < links; ++i)
        for (int k = 0; k < 7; ++k)
          EXPECT_EQ(shown.poses[(sample * links + i) * 7 + k], batch.link_poses(motion.links[i].link)(k, e));
      for (int dof = 0; dof < plan.dofs(); ++dof) EXPECT_EQ(shown.curves[dof][sample], batch.positions()(dof, e));
      EXPECT_EQ(shown.curves[shown.curves.size() - 2][sample], batch.kinetic_energies()(0, e));
      EXPECT_EQ(shown.curves.back()[sample], batch.potential_energies()(0, e));
      Batch<float>::Array forces(3 * pairs, 3);
      const Query query{Quantity::contact_force};
      batch.read(std::span(&query, 1), {forces.data(), 3, 1});
      for (std::size_t p = 0; p < pairs; ++p)
        for (int k = 0; k < 3; ++k)
          EXPECT_NEAR(shown.pushes[(sample * pairs + p) * 6 + 3 + k], forces(3 * p + k, e),
                      1e-5 * forces.abs().maxCoeff());
    }
    batch.step(24);
  }
  // The box lies on the ground, which carries its weight at its lower face.
  const int ground = plan.contact("ground-box");
  const float* push = motion.tracks[0].pushes.data() + (3 * pairs + ground) * 6;
  EXPECT_NEAR(push[5], 0.2 * 9.81, 0.01);
  EXPECT_NEAR(push[2], 0.0, 1e-4);
}

// By the page's own time, whatever a batch counts since its resets.
TEST(Motion, knows_when_environments_are_frozen_and_when_they_step_again) {
  const Plan plan = plan_of(arm_gripper, "0.9");
  Batch<double> batch(plan, 2, {.threads = 1});
  batch.step(240);  // before the first sample
  Motion motion(plan, true, {"a", "b"});
  motion.add(0.0, batch, {0, 1});
  batch.velocities()(0, 1) = std::nan("");
  batch.step();
  motion.add(0.1, batch, {0, 1});
  motion.add(0.2, batch, {0, 1});
  batch.reset();
  batch.step(24);
  motion.add(0.3, batch, {0, 1});
  batch.velocities()(0, 1) = std::nan("");
  batch.step();
  motion.add(0.4, batch, {0, 1});
  EXPECT_TRUE(motion.tracks[0].frozen.empty());
  const std::vector<Track::Frozen>& frozen = motion.tracks[1].frozen;
  ASSERT_EQ(frozen.size(), 2u);
  EXPECT_GE(frozen[0].time, 0.0);
  EXPECT_LE(frozen[0].time, 0.1);
  EXPECT_EQ(frozen[0].until, 0.3);
  EXPECT_GE(frozen[1].time, 0.3);
  EXPECT_LE(frozen[1].time, 0.4);
  EXPECT_FALSE(frozen[1].until);
  const nlohmann::json json = nlohmann::json::parse(motion_json(motion, "about", {}));
  EXPECT_TRUE(json["environments"][0]["faults"].empty());
  EXPECT_EQ(json["environments"][1]["faults"][0]["until"], 0.3);
  EXPECT_EQ(json["environments"][1]["faults"][1]["name"], to_string(frozen[1].fault));
}

class View : public Command {
 protected:
  // A recording of one environment, in double.
  Table record(const std::string& file, Arguments more) const {
    Arguments arguments = {"simulate",  file,  "--envs",    "2",   "--precision", "f64",
                           "--seconds", "0.5", "--perturb", "0.2", "--record",    path("r.csv")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(run(arguments).status, 0);
    return read_csv(path("r.csv"));
  }

  std::string refusal(const std::string& csv) const {
    try {
      recording_of(read_csv(write("bad.csv", csv)), plan_of(model));
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing";
  }
};

// A batch of one environment, put to each row by hand.
TEST_F(View, replays_the_poses_of_the_recorded_states) {
  const Plan plan = plan_of(arm_gripper);
  const Table table = record(arm_gripper, {});
  const Motion motion = replay({recording_of(table, plan)}, plan, {}, 30.0, 1);
  ASSERT_EQ(motion.times.size(), 16u);  // every eighth of 120 steps, and the start
  Batch<double> batch(plan, 1, {.threads = 1});
  const std::vector<StateColumn> columns = state_columns(plan);
  for (std::size_t sample = 0; sample < motion.times.size(); ++sample) {
    const std::vector<double>& row = table.rows[8 * sample];
    EXPECT_EQ(motion.times[sample], static_cast<float>(row[0]));
    for (std::size_t c = 0; c < table.columns.size(); ++c)
      for (const StateColumn& column : columns)
        if (column.name == table.columns[c]) state_view(batch, column.kind)(column.row, 0) = row[c];
    for (std::size_t i = 0; i < motion.links.size(); ++i)
      for (int k = 0; k < 7; ++k)
        EXPECT_EQ(motion.tracks[0].poses[(sample * motion.links.size() + i) * 7 + k],
                  static_cast<float>(batch.link_poses(motion.links[i].link)(k, 0)));
  }
}

TEST_F(View, refuses_what_is_no_recording_of_the_model) {
  const std::string head = "time,shoulder,shoulder.v,elbow,elbow.v,wrist,wrist.v,slide,slide.v,C.elbow,C.slide,fault\n";
  const std::string row = ",0,0,0,0,0,0,0.01,0,0,0,0\n";
  EXPECT_EQ(refusal(head + "0" + row + "0.1" + row), "nothing");
  const auto expect = [&](const std::string& csv, const char* said) {
    EXPECT_NE(refusal(csv).find(said), std::string::npos) << refusal(csv);
  };
  expect(head + "0" + row + "0" + row, "bad.csv:3:1: the time 0 s is not after 0 s");
  expect(head + "0,0,0,0,0,0,0,0.01,0,0,0,9\n", "bad.csv:2:12: 9 is the number of no fault");
  expect(head + "0,0,0,0,0,0,0,0.01,0,0,0,0.5\n", "bad.csv:2:12");
  expect("time,shoulder,fault\n0,0,0\n", "bad.csv:1: there is no column 'shoulder.v'");
  expect("shoulder,shoulder.v,fault\n0,0,0\n", "bad.csv:1: there is no column 'time'");
  expect("time,knee,fault\n0,0,0\n", "bad.csv:1:2: unknown column 'knee'");
  expect(head + "0" + row + "soon" + row, "bad.csv:3:1");
  expect(head + "0,1\n", "bad.csv:2");

  const Plan plan = plan_of(model);
  Recording one = recording_of(read_csv(write("one.csv", head + "0" + row)), plan);
  Recording two = recording_of(read_csv(write("two.csv", head + "0.1" + row)), plan);
  EXPECT_THROW(replay({one, two}, plan, {}, 60.0, 1), InputError);
}

TEST_F(View, marks_where_a_recording_froze) {
  const std::string text =
      "time,shoulder,shoulder.v,elbow,elbow.v,wrist,wrist.v,slide,slide.v,C.elbow,C.slide,fault\n"
      "0,0,0,0,0,0,0,0.01,0,0,0,0\n0.25,0,0,0,0,0,0,0.01,0,0,0,2\n0.5,0,0,0,0,0,0,0.01,0,0,0,2\n";
  const Recording recording = recording_of(read_csv(write("frozen.csv", text)), plan_of(model));
  ASSERT_TRUE(recording.frozen);
  EXPECT_EQ(recording.frozen->time, 0.25);
  EXPECT_EQ(recording.frozen->fault, Fault::diverged);
}

TEST_F(View, json_describes_its_numbers) {
  Model named = plan_of(arm_gripper, "0.9").model();
  named.name = "</script><!-- \xff";
  const Plan plan = compile(named);
  Batch<float> batch(plan, 1, {.threads = 1});
  Motion motion(plan, true, {"<b>"});
  motion.add(0.0, batch, {0});
  batch.step(4);
  motion.add(4.0 / 240, batch, {0});
  const std::string text = motion_json(motion, "about", {"note"});
  EXPECT_EQ(text.find('<'), std::string::npos);
  const nlohmann::json json = nlohmann::json::parse(text);
  EXPECT_EQ(json["environments"][0]["label"], "<b>");
  EXPECT_EQ(json["world"][0]["kind"], "half_space");
  EXPECT_EQ(json["floats"], false);  // the box floats, the arm does not
  const std::vector<unsigned char> bytes = decoded(json["numbers"]);
  const Track& track = motion.tracks[0];
  const std::size_t samples = json["samples"], pairs = json["contacts"].size(), links = json["links"].size();
  const std::size_t curves = json["joints"].size() + json["couplings"].size() + pairs + 2;
  ASSERT_EQ(bytes.size(), 4 * samples * (1 + 7 * links + 6 * pairs + curves));
  ASSERT_EQ(track.curves.size(), curves);
  std::vector<float> numbers(bytes.size() / 4);
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  EXPECT_EQ(numbers[1], motion.times[1]);
  EXPECT_EQ(numbers[samples], track.poses[0]);
  EXPECT_EQ(numbers[samples * (1 + 7 * links + 6 * pairs) + 1], track.curves[0][1]);
  EXPECT_EQ(numbers.back(), track.curves.back()[1]);
  // The knuckle leads the tips.
  const int knuckle = plan.dof("knuckle");
  EXPECT_FALSE(json["joints"][knuckle].contains("leader"));
  EXPECT_EQ(json["joints"][plan.dof("left_tip_joint")]["leader"], knuckle);
}

// One test for both kinds of build: with the viewer, and without.
TEST_F(View, writes_one_page_or_says_how_to_get_it) {
  const Ran ran = run({"view", model, "--out", path("page.html")});
  if (page_template.empty()) {
    EXPECT_EQ(ran.status, 2);
    EXPECT_NE(ran.err.find("install nodejs and npm"), std::string::npos) << ran.err;
    EXPECT_FALSE(std::filesystem::exists(path("page.html")));
    return;
  }
  EXPECT_EQ(ran.status, 0) << ran.err;
  const std::string page = contents(path("page.html"));
  EXPECT_EQ(page.find("/*MOTION*/"), std::string::npos);
  EXPECT_NE(page.find("{\"model\":\"linkage\""), std::string::npos);
  EXPECT_LT(page.size(), 1'000'000u);
  EXPECT_NE(page.find("three.js authors"), std::string::npos);  // whose licence asks for it
  EXPECT_NE(page.find("Leon Sorokin"), std::string::npos);
}

TEST_F(View, refuses_bad_input_with_exit_code_2) {
  if (page_template.empty()) GTEST_SKIP() << "without the viewer there is one refusal";
  const std::string recording = write("r.csv", "time\n0\n");
  const std::vector<std::pair<Arguments, std::string>> cases = {
      {{"--environments", "1"}, "--environments: 1 is not below the number of environments, 1"},
      {{"--environments", "-1"}, "--environments"},
      {{"--rate", "0"}, "--rate"},
      {{"--record", recording, "--seconds", "1"}, "excludes --record"},
      {{"--record", recording}, "r.csv:1"},
      {{"--record", recording, "--out", recording}, "would be overwritten"},
      {{"--record", "/no/such.csv"}, "/no/such.csv"},
      {{"--out", "/no/such/page.html"}, "/no/such/page.html"},
      {{"--seconds", "1e6", "--rate", "1000"}, "too large for a browser"},
  };
  for (const auto& [more, said] : cases) {
    Arguments arguments = {"view", model};
    arguments.insert(arguments.end(), more.begin(), more.end());
    if (std::find(more.begin(), more.end(), "--out") == more.end())
      arguments.insert(arguments.end(), {"--out", path("page.html")});
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 2) << said;
    EXPECT_NE(ran.err.find(said), std::string::npos) << ran.err;
    EXPECT_FALSE(std::filesystem::exists(path("page.html"))) << said;
  }
}

}  // namespace
}  // namespace lockstep::tool
