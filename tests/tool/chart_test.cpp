// lockstep chart: the table and the picture. SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>
#include <map>
#include <regex>

#include "command.h"
#include "tool/python.h"

namespace lockstep::tool {
namespace {

class Chart : public Command {
 protected:
  Ran chart(Arguments arguments) const {
    arguments.insert(arguments.begin(), {"chart", model, "--budget", "0.2", "--seconds", "0.1", "--envs", "8"});
    return run(arguments);
  }
  std::string picture() const { return path("a 'chart'.svg"); }
};

TEST_F(Chart, writes_a_table_without_a_python) {
  const Ran ran = chart({"--out", picture(), "--python", "/no/such/python"});
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_NE(ran.out.find("/no/such/python does not have matplotlib"), std::string::npos) << ran.out;
  EXPECT_FALSE(std::filesystem::exists(picture()));
  const std::vector<std::string> rows = lines(contents(path("a 'chart'.csv")));
  ASSERT_GT(rows.size(), 1u);
  EXPECT_EQ(rows[0],
            "method,integrator,iterations,dt,precision,rms_error,coupling_error_max,cost_us_per_env_second,"
            "env_steps_per_second,faulted");
}

TEST_F(Chart, is_no_picture_where_a_python_draws_nothing) {
  if (!std::filesystem::exists("/bin/true")) GTEST_SKIP() << "there is no /bin/true";
  for (const char* old : {"", "an older picture"}) {
    if (*old) write("a 'chart'.svg", old);
    const Ran ran = chart({"--out", picture(), "--python", "/bin/true"});
    EXPECT_EQ(ran.status, 2);
    EXPECT_NE(ran.err.find("/bin/true has drawn nothing"), std::string::npos) << ran.err;
  }
}

// Semi-implicit Euler is of first order on a smooth scene.
TEST_F(Chart, shows_first_order_and_couplings_at_rounding_for_reduced) {
  ASSERT_EQ(chart({"--out", picture(), "--python", "/no/such/python"}).status, 0);
  std::vector<double> errors;
  for (const std::string& row : lines(contents(path("a 'chart'.csv")))) {
    if (!row.starts_with("reduced,") || row.find(",f64,") == std::string::npos) continue;
    std::vector<std::string> cells;
    std::istringstream stream(row);
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    errors.push_back(std::stod(cells[5]));
    EXPECT_LT(std::stod(cells[6]), 1e-12) << row;
    EXPECT_GT(std::stod(cells[7]), 0.0) << row;
  }
  ASSERT_EQ(errors.size(), 5u);
  EXPECT_NEAR(errors[3] / errors[4], 2.0, 0.1);
}

// Positions by time of a trajectory that `simulate` recorded.
std::map<double, std::vector<double>> trajectory(const std::string& csv) {
  std::map<double, std::vector<double>> rows;
  const std::vector<std::string> all = lines(csv);
  std::vector<bool> position;
  std::istringstream header(all.at(0));
  for (std::string name; std::getline(header, name, ',');)
    position.push_back(name != "time" && name.find(".v") == std::string::npos && !name.starts_with("C."));
  for (std::size_t row = 1; row < all.size(); ++row) {
    std::istringstream stream(all[row]);
    std::vector<double> numbers;
    for (std::string cell; std::getline(stream, cell, ',');) numbers.push_back(std::stod(cell));
    auto& positions = rows[std::round(numbers.at(0) * 1e6)];
    for (std::size_t i = 0; i < numbers.size(); ++i)
      if (position[i]) positions.push_back(numbers[i]);
  }
  return rows;
}

// RMS difference of the joints over the samples, which are a sixtieth of a second apart.
double distance(const std::map<double, std::vector<double>>& a, const std::map<double, std::vector<double>>& b,
                int samples) {
  double sum = 0.0;
  long count = 0;
  for (int sample = 1; sample <= samples; ++sample) {
    const double at = std::round(sample / 60.0 * 1e6);
    for (std::size_t i = 0; i < a.at(at).size(); ++i, ++count) sum += std::pow(a.at(at)[i] - b.at(at)[i], 2);
  }
  return std::sqrt(sum / static_cast<double>(count));
}

// A start that satisfies the couplings.
constexpr const char* moving = "shoulder,shoulder.v,elbow,elbow.v,slide\n0.6,2,-0.6,-2,0.01\n";

// A simulation by each line of advice keeps the promised error. The exact motion is a run of another integrator with
// small steps.
TEST_F(Chart, gives_advice_that_holds_when_it_is_followed) {
  const std::string state = write("start.csv", moving);
  const auto simulated = [&](Arguments more) {
    Arguments arguments = {
        "simulate", model,          "--state", state,      "--seconds",
        "0.5",      "--envs",       "1",       "--ignore", "position_limits,velocity_limits,effort_limits,friction",
        "--record", path("run.csv")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 0) << ran.err;
    return trajectory(contents(path("run.csv")));
  };
  const auto exact = simulated({"--integrator", "runge_kutta", "--dt", "1/7680", "--precision", "f64"});
  const Ran ran = run({"chart", model, "--budget", "0.5", "--seconds", "0.5", "--envs", "8", "--state", state,
                       "--ignore", "position_limits,velocity_limits,effort_limits,friction", "--out", picture(),
                       "--python", "/no/such/python"});
  ASSERT_EQ(ran.status, 0) << ran.err;
  const std::regex pattern(
      R"(advice +for (\S+) rad.* over .* s: (\w+)(?: \((\w+)( \d+)?\))? at (\S+) s in (f32|f64),)");
  int followed = 0;
  for (const std::string& line : lines(ran.out)) {
    if (!line.starts_with("advice")) continue;
    std::smatch part;
    ASSERT_TRUE(std::regex_search(line, part, pattern)) << line;
    Arguments arguments = {"--integrator", part[2], "--dt", part[5], "--precision", part[6]};
    if (part[3].matched) arguments.insert(arguments.end(), {"--method", part[3]});
    if (part[4].matched) arguments.insert(arguments.end(), {"--iterations", part[4].str().substr(1)});
    EXPECT_LE(distance(simulated(arguments), exact, 30), 1.01 * std::stod(part[1])) << line;
    ++followed;
  }
  EXPECT_GE(followed, 3);
}

TEST_F(Chart, runs_let_simulate_choose_a_step_for_a_tolerance) {
  const std::string state = write("start.csv", moving);
  const Arguments common = {
      "simulate", model,    "--state", state,      "--seconds",
      "0.5",      "--envs", "1",       "--ignore", "position_limits,velocity_limits,effort_limits,friction"};
  const auto with = [&](Arguments more) {
    more.insert(more.begin(), common.begin(), common.end());
    return run(more);
  };
  ASSERT_EQ(with({"--integrator", "runge_kutta", "--dt", "1/7680", "--precision", "f64", "--record", path("exact.csv")})
                .status,
            0);
  const auto exact = trajectory(contents(path("exact.csv")));
  for (const char* tolerance : {"1e-2", "1e-4", "1e-6"}) {
    const Ran ran = with({"--tolerance", tolerance, "--precision", "f64", "--record", path("run.csv")});
    ASSERT_EQ(ran.status, 0) << ran.err;
    EXPECT_NE(ran.out.find("chosen   "), std::string::npos) << ran.out;
    EXPECT_LE(distance(trajectory(contents(path("run.csv"))), exact, 30), 1.01 * std::stod(tolerance)) << ran.out;
  }
  EXPECT_NE(with({"--tolerance", "1e-2", "--integrator", "euler"}).out.find("chosen   euler"), std::string::npos);
  const Ran refused = with({"--tolerance", "1e-30"});
  EXPECT_EQ(refused.status, 2);
  expect_one_complaint(refused.err, "--tolerance");
  EXPECT_EQ(with({"--tolerance", "1e-3", "--dt", "1/240"}).status, 2) << "--tolerance chooses the step";
}

// Their time is a number of steps, so each step has another motion.
TEST_F(Chart, delays_are_said_to_change_with_the_step) {
  const std::string file =
      write("late.xml",
            "<mujoco><option timestep='0.001'/><worldbody><body><joint name='j' axis='0 0 1'/><geom size='0.1'/></body>"
            "</worldbody><actuator><position joint='j' kp='1' delay='0.05' nsample='50'/></actuator></mujoco>");
  const Ran refused = run({"simulate", file, "--tolerance", "1e-2"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.err.find("the delay of joint 'j' is a number of steps, 50"), std::string::npos) << refused.err;
  const Ran other = run({"simulate", file, "--envs", "1", "--seconds", "0.1"});
  EXPECT_EQ(other.status, 0);
  EXPECT_NE(other.err.find("50 steps, 0.2083 s at this step of 1/240 s and 0.05 s at the file's; give --dt 0.001"),
            std::string::npos)
      << other.err;
  const Ran same = run({"simulate", file, "--envs", "1", "--seconds", "0.1", "--dt", "0.001"});
  EXPECT_EQ(same.err.find("delay"), std::string::npos) << same.err;
}

TEST_F(Chart, of_several_ranks_is_that_of_one_process) {
  const auto table = [&](const std::string& rank) {
    const Ran ran = chart({"--out", picture(), "--rank", rank, "--python", "/no/such/python"});
    EXPECT_EQ(ran.status, 0) << ran.err;
    return contents(path("a 'chart'.csv"));
  };
  // Settings and errors; costs are measured anew.
  const auto errors = [&](const std::string& text) {
    std::vector<std::string> all;
    for (const std::string& row : lines(text)) {
      std::size_t end = 0;
      for (int cell = 0; cell < 7; ++cell) end = row.find(',', end + 1);
      all.push_back(row.substr(0, end));
    }
    return all;
  };
  const std::string alone = table("0/1"), joined = table("0/3") + table("1/3") + table("2/3");
  EXPECT_EQ(errors(joined), errors(alone));
  EXPECT_FALSE(std::filesystem::exists(picture()));
  if (!find_python("")) GTEST_SKIP() << "no Python with matplotlib here";
  const Ran drawn = chart({"--out", picture(), "--table", write("joined.csv", joined)});
  EXPECT_EQ(drawn.status, 0) << drawn.err;
  EXPECT_NE(contents(picture()).find("<svg"), std::string::npos);
  EXPECT_EQ(chart({"--out", picture(), "--table", path("none.csv")}).status, 2);
}

TEST_F(Chart, of_a_table_that_is_none_is_refused) {
  for (const char* text : {"", "a,b\n1,2\n", "method,integrator\nreduced,euler\n"}) {
    const Ran ran = chart({"--out", picture(), "--table", write("table.csv", text)});
    EXPECT_EQ(ran.status, 2) << text;
    expect_one_complaint(ran.err, "table.csv");
  }
  EXPECT_EQ(chart({"--out", picture(), "--table", write("table.csv", ""), "--csv", path("c.csv")}).status, 2);
}

TEST_F(Chart, draws_a_picture_with_a_python) {
  if (!find_python("")) GTEST_SKIP() << "no Python with matplotlib here";
  const Ran ran = chart({"--out", picture()});
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_NE(contents(picture()).find("<svg"), std::string::npos);
  const Ran refused = chart({"--out", path("a.chart")});
  EXPECT_EQ(refused.status, 2);
  expect_one_complaint(refused.err, "a.chart");
}

}  // namespace
}  // namespace lockstep::tool
