// The built command as a user runs it: targets, results, engines, faults. SPDX-License-Identifier: Apache-2.0
#include "command.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tool/csv.h"

namespace lockstep::tool {
namespace {

// With h = 0.01, a row at 0.02, or less than h/1000 later, holds from the step that starts at 0.02. That step writes
// the third row after the start.
TEST_F(Command, targets_hold_from_the_step_that_starts_at_their_time) {
  const Arguments how = {"--dt", "0.01", "--seconds", "0.05", "--drive", "wrist=5,0.1"};
  const auto with_targets = [&](const std::string& text) {
    Arguments arguments = how;
    arguments.insert(arguments.end(), {"--targets", write("targets.csv", text)});
    return lines(recorded(arguments));
  };
  const std::vector<std::string> without = lines(recorded(how));
  for (const char* time : {"0.02", "0.020009", "0.0101"}) {
    const std::vector<std::string> with = with_targets(std::string("time,wrist\n") + time + ",0.5\n");
    ASSERT_EQ(with.size(), without.size());
    for (std::size_t i = 0; i <= 3; ++i) EXPECT_EQ(with[i], without[i]) << time;
    EXPECT_NE(with[4], without[4]) << time;
  }
  EXPECT_EQ(with_targets("time,wrist\n0.020011,0.5\n")[4], without[4]);
  EXPECT_NE(with_targets("time,wrist\n0.020011,0.5\n")[5], without[5]);
  // Of several rows that are due, the last one holds.
  EXPECT_EQ(with_targets("time,wrist\n-1,3\n0,1\n0,0.5\n"), with_targets("time,wrist\n0,0.5\n"));
}

TEST_F(Command, json_has_the_documented_keys) {
  simulate({"--json", path("r.json"), "--method", "pgs", "--iterations", "7", "--threads", "2", "--precision", "f64"});
  const auto json = nlohmann::json::parse(contents(path("r.json")));
  for (const char* key : {"env_steps_per_second", "coupling_error_max", "coupling_error_rms", "stepping_seconds"})
    EXPECT_TRUE(json.at(key).is_number()) << key;
  EXPECT_GT(json.at("env_steps_per_second"), 0.0);
  EXPECT_GE(json.at("coupling_error_max"), json.at("coupling_error_rms"));
  EXPECT_EQ(json.at("faulted_environments"), 0);
  EXPECT_EQ(json.at("diagnosed_environments"), 9);
  EXPECT_GE(json.at("energy_excess_max"), 0.0);
  EXPECT_GE(json.at("limit_violation_max"), 0.0);
  EXPECT_GT(json.at("speed_max"), 0.0);
  EXPECT_GE(json.at("conflict_count"), 0);
  EXPECT_TRUE(json.at("conflicts").is_array());
  EXPECT_EQ(json.at("method"), "pgs");
  EXPECT_EQ(json.at("iterations"), 7);
  EXPECT_EQ(json.at("precision"), "f64");
  EXPECT_EQ(json.at("threads"), 2);
  EXPECT_TRUE(json.at("target").is_string());
  EXPECT_TRUE(json.at("engine") == "tables" || json.at("engine") == "compiled") << json.at("engine");
  EXPECT_EQ(json.at("integrator"), "euler");
  EXPECT_EQ(json.at("dt"), 1.0 / 240);
  EXPECT_EQ(json.at("envs"), 9);
  EXPECT_EQ(json.at("steps"), 240);
}

TEST_F(Command, tells_how_far_loops_are_open) {
  const std::string four_bar = write("four_bar.xml", R"(<mujoco><worldbody>
    <body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" contype="0" conaffinity="0"/>
      <body name="coupler" pos="0.1 0 0"><joint axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.01" contype="0" conaffinity="0"/></body></body>
    <body name="rocker" pos="0.35 0 0"><joint axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.01" contype="0" conaffinity="0"/></body></worldbody>
    <equality><connect body1="coupler" body2="rocker" anchor="0.3 0 0"/></equality></mujoco>)");
  const Ran ran = run({"simulate", four_bar, "--envs", "3", "--integrator", "euler", "--json", path("r.json")});
  EXPECT_NE(ran.out.find("3 joints, 0 couplings, 1 loop, fixed base"), std::string::npos) << ran.out << ran.err;
  const double open = nlohmann::json::parse(contents(path("r.json"))).at("coupling_error_max").get<double>();
  EXPECT_GT(open, 1e-7);
  EXPECT_LT(open, 1e-3);
}

TEST_F(Command, runs_the_engine_that_is_named) {
  if (run({"simulate", model, "--engine", "compiled"}).err.find("machine code is made for") != std::string::npos)
    GTEST_SKIP() << "no machine code for this processor";
  const Arguments common = {"--precision", "f64", "--seconds", "0.2", "--json", path("r.json")};
  std::vector<Table> tables;
  for (const std::string engine : {"tables", "compiled"}) {
    Arguments arguments = common;
    arguments.insert(arguments.end(), {"--engine", engine, "--record", path(engine + ".csv")});
    const Ran ran = simulate(arguments);
    EXPECT_EQ(nlohmann::json::parse(contents(path("r.json"))).at("engine"), engine);
    EXPECT_TRUE(lines(ran.out).at(1).starts_with("method ") && lines(ran.out)[1].ends_with(", " + engine)) << ran.out;
    tables.push_back(read_csv(path(engine + ".csv")));
  }
  ASSERT_EQ(tables[0].rows.size(), 1u + 48);
  ASSERT_EQ(tables[1].rows.size(), 1u + 48);
  for (std::size_t row = 0; row < tables[0].rows.size(); ++row)
    for (std::size_t column = 0; column < tables[0].columns.size(); ++column)
      EXPECT_NEAR(tables[0].rows[row][column], tables[1].rows[row][column], 1e-12) << row << ' ' << column;
  Arguments automatic = common;
  automatic.insert(automatic.end(), {"--engine", "automatic"});
  simulate(automatic);
  EXPECT_NE(nlohmann::json::parse(contents(path("r.json"))).at("engine"), "automatic");
}

TEST_F(Command, refuses_an_engine_that_does_not_take_the_plan) {
  for (const Arguments& arguments :
       {Arguments{"--engine", "generated"}, {"--engine", "compiled", "--method", "pgs", "--drive", "wrist=5,0.1"}}) {
    Arguments all = {"simulate", model};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Ran ran = run(all);
    EXPECT_EQ(ran.status, 2);
    expect_one_complaint(ran.err, "engine: " + arguments[1] + " does not apply");
  }
}

// The elbow mimics the shoulder with multiplier -1: both cannot be at 0.5.
TEST_F(Command, json_names_what_could_not_be_met) {
  const std::string targets = write("targets.csv", "time,shoulder,elbow\n0.1,0.5,0.5\n");
  const Arguments how = {"--dt",  "0.01",        "--seconds", "0.2",         "--targets",
                         targets, "--kinematic", "shoulder",  "--kinematic", "elbow"};
  Arguments with_json = how;
  with_json.insert(with_json.end(), {"--envs", "70", "--json", path("r.json")});
  with_json.insert(with_json.begin(), {"simulate", model});
  const Ran ran = run(with_json);
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_NE(ran.out.find("warning  bounds and couplings could not all be met in 64 of the 64 environments"),
            std::string::npos)
      << ran.out;
  const auto json = nlohmann::json::parse(contents(path("r.json")));
  EXPECT_EQ(json.at("diagnosed_environments"), 64);
  EXPECT_EQ(json.at("conflict_count"), 64);
  ASSERT_EQ(json.at("conflicts").size(), 16u);
  for (int e = 0; e < 16; ++e) {
    const auto& conflict = json.at("conflicts").at(e);
    EXPECT_EQ(conflict.at("environment"), e);
    EXPECT_NEAR(conflict.at("time").get<double>(), 0.11, 1e-9);  // the end of the first step that has the targets
    EXPECT_NE(conflict.at("rows").dump().find("kinematic drive"), std::string::npos) << conflict;
  }
  const std::string without_json = simulate(how).out;
  EXPECT_NE(without_json.find("warning  bounds and couplings could not all be met in 9 of the 9"), std::string::npos)
      << without_json;
}

// The state file has a row for each environment, also for those that are not diagnosed.
TEST_F(Command, json_diagnoses_the_first_environments_of_many) {
  std::string states = "wrist.v\n";
  for (int e = 0; e < 70; ++e) states += e == 63 ? "2\n" : e == 64 ? "50\n" : "0\n";
  const Ran ran = run({"simulate", model, "--envs", "70", "--state", write("each.csv", states), "--seconds", "1/240",
                       "--gravity", "0,0,0", "--json", path("r.json")});
  EXPECT_EQ(ran.status, 0) << ran.err;
  const auto json = nlohmann::json::parse(contents(path("r.json")));
  EXPECT_LE(json.at("speed_max"), 2.0);  // of environment 63, which damping slows; 64 is faster and not diagnosed
  EXPECT_GT(json.at("speed_max"), 0.5);
  EXPECT_EQ(json.at("conflict_count"), 0);
  EXPECT_TRUE(json.at("conflicts").empty());
}

TEST_F(Command, says_that_it_rounded_the_time) {
  EXPECT_NE(simulate({"--seconds", "1", "--dt", "0.3"}).out.find("rounded"), std::string::npos);
  EXPECT_EQ(simulate({"--seconds", "1", "--dt", "0.1"}).out.find("rounded"), std::string::npos);
}

TEST_F(Command, perturbed_starts_differ_satisfy_the_couplings_and_repeat) {
  const auto start = [&](Arguments arguments) {
    arguments.insert(arguments.end(), {"--perturb", "0.2", "--seconds", "0.1"});
    return recorded(arguments);
  };
  const std::string one = start({"--threads", "1", "--record-env", "5"});
  EXPECT_EQ(one, start({"--threads", "2", "--record-env", "5"}));
  EXPECT_NE(one, start({"--threads", "1", "--record-env", "4"}));
  EXPECT_NE(one, start({"--threads", "1", "--record-env", "5", "--seed", "2"}));
  start({"--precision", "f64"});
  const Table table = read_csv(path("record.csv"));
  EXPECT_NE(table.rows[0][1], 0.0);
  for (const int coupling : {9, 10}) EXPECT_LT(std::abs(table.rows[0][coupling]), 1e-15);
}

TEST_F(Command, ranks_end_together_as_one_process_does) {
  std::string starts = "wrist.v\n";
  for (int e = 0; e < 11; ++e) starts += std::to_string(e) + "\n";
  const std::string state = write("starts.csv", starts);
  const auto end = [&](const std::string& rank, Arguments more = {}) {
    Arguments arguments = {"simulate",     model,           "--envs",  "11",          "--seconds", "0.2",
                           "--perturb",    "0.1",           "--state", state,         "--rank",    rank,
                           "--end-states", path("end.csv"), "--json",  path("r.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 0) << ran.err;
    return contents(path("end.csv"));
  };
  const std::string alone = end("0/1", {"--record", path("alone.csv"), "--record-env", "6"});
  for (const int ranks : {2, 3, 4}) {
    std::string joined;
    for (int rank = 0; rank < ranks; ++rank) joined += end(fmt::format("{}/{}", rank, ranks));
    EXPECT_EQ(joined, alone) << ranks;
  }
  EXPECT_EQ(nlohmann::json::parse(contents(path("r.json"))).at("first_id"), 9);
  // The rank that has the environment records it, and it goes on from a file to the same bits.
  end("0/2", {"--record", path("first.csv"), "--record-env", "6"});
  end("1/2", {"--record", path("second.csv"), "--record-env", "6"});
  EXPECT_FALSE(std::filesystem::exists(path("first.csv")));
  EXPECT_EQ(contents(path("second.csv")), contents(path("alone.csv")));
  const Table table = read_csv(write("states.csv", alone));
  EXPECT_EQ(table.rows.size(), 11u);
  EXPECT_NE(table.rows[0], table.rows[1]);
  // From its end it goes on as it would have: what the file has are the bits.
  const auto from = [&](const std::string& states, const std::string& seconds) {
    EXPECT_EQ(run({"simulate", model, "--envs", "11", "--state", states, "--seconds", seconds, "--end-states",
                   path("end.csv")})
                  .status,
              0);
    return contents(path("end.csv"));
  };
  const std::string half = write("half.csv", from(state, "24/240"));
  EXPECT_EQ(from(half, "24/240"), from(state, "48/240"));
  EXPECT_EQ(run({"simulate", model, "--envs", "22", "--rank", "0/2", "--state", state}).status, 2) << "11 rows for 22";
  // Ranks that one command starts have names of their own.
  const Arguments started = {"simulate", model, "--envs", "11", "--seconds", "0.2", "--rank", "auto"};
  setenv("RANK", "1", 1), setenv("WORLD_SIZE", "2", 1);
  Arguments same = started, own = started;
  same.insert(same.end(), {"--end-states", path("same.csv")});
  own.insert(own.end(), {"--end-states", path("own{rank}.csv"), "--json", path("own{rank}.json")});
  const Ran refused = run(same);
  EXPECT_EQ(refused.status, 2);
  expect_one_complaint(refused.err, "--end-states: 2 ranks would all write");
  EXPECT_FALSE(std::filesystem::exists(path("same.csv")));
  EXPECT_EQ(run(own).status, 0);
  unsetenv("RANK"), unsetenv("WORLD_SIZE");
  EXPECT_EQ(lines(contents(path("own1.csv"))).size(), 5u);
  EXPECT_EQ(nlohmann::json::parse(contents(path("own1.json"))).at("first_id"), 6);
  for (const char* const wrong : {"2/2", "1", "/2", "0/", "-1/2", "x/2", "0/0", "1/2/3"}) {
    const Ran ran = run({"simulate", model, "--rank", wrong});
    EXPECT_EQ(ran.status, 2) << wrong;
    EXPECT_NE(ran.err.find("--rank"), std::string::npos) << ran.err;
  }
  EXPECT_EQ(run({"simulate", model, "--envs", "2", "--rank", "0/3"}).status, 2);
}

TEST_F(Command, reports_faults_with_exit_code_1_and_one_line) {
  const std::string state = write("wild.csv", "wrist.v\n0\n0\n1e9\n0\n1e9\n0\n0\n0\n0\n");
  const Ran ran = run({"simulate", model, "--envs", "9", "--state", state, "--json", path("r.json")});
  EXPECT_EQ(ran.status, 1);
  expect_one_complaint(ran.err, "2 of 9 environments faulted; the first is number 2: diverged");
  const auto json = nlohmann::json::parse(contents(path("r.json")));
  EXPECT_EQ(json.at("faulted_environments"), 2);
  const auto& first = json.at("first_fault");
  EXPECT_EQ(first.at("environment"), 2);
  EXPECT_EQ(first.at("fault"), "diverged");
  EXPECT_EQ(first.at("code"), "fault.diverged");
  EXPECT_EQ(first.at("stage"), "state");
  EXPECT_EQ(first.at("joint"), "wrist");
  EXPECT_EQ(first.at("step"), 0);
  EXPECT_EQ(first.at("time"), 0.0);
  EXPECT_TRUE(std::isfinite(json.at("coupling_error_max").get<double>()));
}

TEST_F(Command, writes_the_code_of_an_error) {
  const Ran ran = run({"simulate", model, "--ignore", "friction:nobody", "--json", path("r.json")});
  EXPECT_NE(ran.status, 0);
  const auto json = nlohmann::json::parse(contents(path("r.json")));
  EXPECT_EQ(json.at("error").at("code"), "settings.ignore");
  EXPECT_EQ(json.size(), 1u);
}

TEST_F(Command, record_marks_the_rows_of_a_frozen_environment) {
  const std::string state = write("wild.csv", "wrist.v\n0\n1e9\n");
  for (const char* environment : {"0", "1"}) {
    run({"simulate", model, "--envs", "2", "--state", state, "--seconds", "0.1", "--record", path("r.csv"),
         "--record-env", environment});
    const Table table = read_csv(path("r.csv"));
    ASSERT_EQ(table.columns.back(), "fault");
    EXPECT_EQ(table.rows.front().back(), 0.0) << "before the first step nothing has failed";
    const double fault = environment[0] == '1' ? static_cast<double>(Fault::diverged) : 0.0;
    for (std::size_t row = 1; row < table.rows.size(); ++row) EXPECT_EQ(table.rows[row].back(), fault);
  }
}

}  // namespace
}  // namespace lockstep::tool
