// lockstep chart: the table and the picture. SPDX-License-Identifier: Apache-2.0
#include "tool/command.h"
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

TEST_F(Chart, without_a_python_is_a_table) {
  const Ran ran = chart({"--out", picture(), "--python", "/no/such/python"});
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_NE(ran.out.find("/no/such/python does not have matplotlib"), std::string::npos) << ran.out;
  EXPECT_FALSE(std::filesystem::exists(picture()));
  const std::vector<std::string> rows = lines(contents(path("a 'chart'.csv")));
  ASSERT_GT(rows.size(), 1u);
  EXPECT_EQ(rows[0], "method,integrator,iterations,dt,precision,rms_error,coupling_error_max,cost_us_per_env_second,"
                     "env_steps_per_second,faulted");
}

// On a smooth scene semi-implicit Euler is of first order: a chart that shows anything else is wrong.
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

TEST_F(Chart, with_a_python_is_a_picture_too) {
  if (!find_python("")) GTEST_SKIP() << "no python with matplotlib here";
  const Ran ran = chart({"--out", picture()});
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_NE(contents(picture()).find("<svg"), std::string::npos);
  const Ran refused = chart({"--out", path("a.chart")});
  EXPECT_EQ(refused.status, 2);
  expect_one_complaint(refused.err, "a.chart");
}

}  // namespace
}  // namespace lockstep::tool
