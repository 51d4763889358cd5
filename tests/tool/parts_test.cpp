// The parts of the command: numbers, tables, options, starts. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "lockstep/error.h"
#include "tool/chart_runs.h"
#include "tool/csv.h"
#include "tool/options.h"
#include "tool/output.h"
#include "tool/progress.h"
#include "tool/python.h"
#include "tool/ranges.h"
#include "tool/state.h"
#include "tool/targets.h"
#include "tool/text.h"
#include "tool/tool.h"

namespace lockstep::tool {
namespace {

// The message of the InputError that `action` throws.
template <class Action>
std::string complaint(Action action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing";
}

// Four joints in a row: b follows a, c follows b, and d is free.
Model chain() {
  Model model;
  model.name = "chain";
  model.roots = {{"base"}};
  const Inertia box = Inertia::box(0.2, {0.1, 0.04, 0.04}, {0.05, 0, 0});
  model.links = {{"base", box}};
  for (const char* name : {"a", "b", "c", "d"}) {
    Joint joint;
    joint.name = name, joint.kind = JointKind::revolute;
    joint.parent = model.links.back().name, joint.child = std::string("link_") + name;
    model.links.push_back({joint.child, box});
    model.joints.push_back(joint);
  }
  model.couplings = {Coupling::mimic("b", "a", -2.0, 0.1), Coupling::mimic("c", "b", 0.5)};
  return model;
}

Eigen::VectorXd errors(const Model& model, const Eigen::VectorXd& q) {
  Eigen::VectorXd result(model.couplings.size());
  for (std::size_t c = 0; c < model.couplings.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    result[c] = q[model.joint_index(coupling.joint)] + coupling.offset;
    for (const CouplingTerm& term : coupling.terms) result[c] += term.ratio * q[model.joint_index(term.joint)];
  }
  return result;
}

TEST(Numbers, are_read_from_whole_texts_only) {
  EXPECT_EQ(to_number(" -1.5e-3\t"), -1.5e-3);
  EXPECT_EQ(to_number("+2"), 2.0);
  for (const char* text : {"", " ", "1.5x", "1,5", "nan", "inf", "1e999", "+-1", "0x10", "1 2"})
    EXPECT_FALSE(to_number(text)) << text;
}

TEST(Numbers, may_be_fractions) {
  EXPECT_EQ(to_fraction("1/240"), 1.0 / 240.0);
  EXPECT_EQ(to_fraction("0.5"), 0.5);
  for (const char* text : {"1/0", "/2", "1/", "1/2/3", "a/b"}) EXPECT_FALSE(to_fraction(text)) << text;
  EXPECT_EQ(seconds_of("1/60", "--dt"), 1.0 / 60.0);
  EXPECT_EQ(complaint([] { seconds_of("-1", "--dt"); }), "--dt: '-1' is not a time in s, a number or fraction above 0");
}

TEST(Numbers, come_in_lists) {
  EXPECT_EQ(to_numbers("0, -1,2.5", 3, "--gravity"), (std::vector{0.0, -1.0, 2.5}));
  EXPECT_EQ(complaint([] { to_numbers("0,1", 3, "--gravity"); }),
            "--gravity: '0,1' should be 3 numbers separated by commas");
  EXPECT_EQ(complaint([] { to_numbers("0,1,up", 3, "--gravity"); }), "--gravity: 'up' is not a finite number");
}

TEST(Numbers, are_written_for_people) {
  EXPECT_EQ(with_prefix(950), "950");
  EXPECT_EQ(with_prefix(1234), "1.23 k");
  EXPECT_EQ(with_prefix(999.9), "1.00 k");
  EXPECT_EQ(with_prefix(12.34e6), "12.3 M");
  EXPECT_EQ(fraction(1.0 / 240), "1/240");
  EXPECT_EQ(fraction(0.3), "0.3");
  EXPECT_EQ(progress_line(30, 120, 10, "steps"), "[#######.......................]  25 %  3.00 steps/s  30 s left");
}

TEST(Csv, reads_what_programs_write) {
  const Table table = parse_csv("\xEF\xBB\xBFtime, \"a,\"\"b\"\"\" ,c\r\n\r\n0,1,-2e-3\r\n\n1, 2 ,\"3\"\n", "t.csv");
  EXPECT_EQ(table.columns, (std::vector<std::string>{"time", "a,\"b\"", "c"}));
  EXPECT_EQ(table.rows, (std::vector<std::vector<double>>{{0, 1, -2e-3}, {1, 2, 3}}));
  EXPECT_EQ(table.at(1, 2), "t.csv:5:3");
}

TEST(Csv, names_file_line_and_column_of_what_it_refuses) {
  const auto refused = [](const char* text) { return complaint([text] { parse_csv(text, "t.csv"); }); };
  EXPECT_EQ(refused("a,b\n1,2\n3,x\n"), "t.csv:3:2: 'x' in column 'b' is not a finite number");
  EXPECT_EQ(refused("a,b\n1,\n"), "t.csv:2:2: '' in column 'b' is not a finite number");
  EXPECT_EQ(refused("a,b\n1,nan\n"), "t.csv:2:2: 'nan' in column 'b' is not a finite number");
  EXPECT_EQ(refused("a,b\n1\n"), "t.csv:2: the row has 1 fields, the header has 2");
  EXPECT_EQ(refused("a,a\n1,2\n"), "t.csv:1:2: column 'a' appears twice");
  EXPECT_EQ(refused("a,,b\n1,2,3\n"), "t.csv:1:2: the column has no name");
  EXPECT_EQ(refused("a,\"b\n1,2\n"), "t.csv:1: a quote is opened and not closed");
  EXPECT_EQ(refused("a,b\n"), "t.csv: has no rows; the first line names the columns, numbers follow");
  EXPECT_EQ(complaint([] { read_csv("/no/such/file.csv"); }), "/no/such/file.csv: does not exist; correct the path");
  EXPECT_EQ(complaint([] { OutputFile("/no/such/file.csv"); }),
            "/no/such/file.csv: cannot be written: No such file or directory");
}

TEST(Csv, refuses_a_folder) {
  EXPECT_NE(complaint([] { read_csv("/"); }), "nothing");
}

TEST(Csv, reports_a_full_disk) {
  EXPECT_EQ(complaint([] {
              OutputFile file("/dev/full");
              file.write("something\n");
              file.close();
            }),
            "/dev/full: cannot be written: No space left on device");
}

TEST(Csv, reads_back_the_fields_that_it_writes) {
  for (const char* name : {"plain", "with,comma", "with\"quote", "both\",\""})
    EXPECT_EQ(parse_csv(csv_field(name) + "\n1\n", "t").columns.at(0), name);
}

TEST(Options, keep_the_gravity_of_the_file_unless_they_give_one) {
  Model model = chain();
  model.gravity = {0, 0, -2};
  apply({}, model);
  EXPECT_EQ(model.gravity, Eigen::Vector3d(0, 0, -2));
}

TEST(Options, change_the_model) {
  Model model = chain();
  ModelOptions options;
  options.floating = true;
  options.gravity = {1, 2, 3};
  options.erp = 0.5;
  options.softness = {"c=30,0.7"};
  options.force_limits = {"b=2.5"};
  options.drives = {"d=100,5"};
  options.kinematic = {"a", "c"};
  apply(options, model);
  EXPECT_TRUE(model.roots[0].floating);
  EXPECT_EQ(model.gravity, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(std::get<Hard>(model.couplings[0].softness).erp, 0.5);
  EXPECT_EQ(std::get<Frequency>(model.couplings[1].softness).rad_per_s, 30.0);
  EXPECT_EQ(std::get<Frequency>(model.couplings[1].softness).damping_ratio, 0.7);
  EXPECT_EQ(model.couplings[0].force_limit, 2.5);
  EXPECT_EQ(model.couplings[1].force_limit, infinity);
  EXPECT_EQ(model.joints[3].drive.kp, 100.0);
  EXPECT_EQ(model.joints[3].drive.kd, 5.0);
  for (const int joint : {0, 1, 2, 3}) EXPECT_EQ(model.joints[joint].drive.kinematic, joint == 0 || joint == 2);
  EXPECT_NO_THROW(model.validate());
}

Ignored ignored_of(const char* list) {
  Ignored ignored;
  ignore_also(list, ignored);
  return ignored;
}

TEST(Options, ignore_bounds_by_name) {
  const auto ignored = [](const char* list) {
    const Ignored i = ignored_of(list);
    return std::array{i.position_limits.all, i.velocity_limits.all, i.effort_limits.all, i.friction.all};
  };
  EXPECT_EQ(ignored("position_limits"), (std::array{true, false, false, false}));
  EXPECT_EQ(ignored("effort_limits,velocity_limits"), (std::array{false, true, true, false}));
  EXPECT_EQ(ignored("position_limits,velocity_limits,effort_limits,friction"), (std::array{true, true, true, true}));
  for (const auto& wrong : {std::pair("speed", "speed"),
                            {"position", "position"},
                            {"position_limits,", ""},
                            {"", ""},
                            {"friction;effort", "friction;effort"}})
    EXPECT_EQ(complaint([&] { ignored_of(wrong.first); }),
              std::string("--ignore: there is no '") + wrong.second +
                  "'; give some of position_limits,velocity_limits,effort_limits,friction, each alone or with :JOINT "
                  "or :followers behind");
  const Ignored some = ignored_of("position_limits:a,friction:followers,position_limits:c d");
  EXPECT_EQ(some.position_limits.names, (std::vector<std::string>{"a", "c d"}));
  EXPECT_TRUE(some.friction.followers && !some.friction.all && !some.position_limits.followers);
  EXPECT_TRUE(some.effort_limits.empty());
  EXPECT_NE(complaint([] { ignored_of("position:"); }), "nothing");
}

TEST(Options, are_for_all_where_they_name_no_joint) {
  Model model = chain();
  model.joints[3].kind = JointKind::fixed;
  ModelOptions options;
  options.softness = {"b=10,1", "30,0.7"};
  options.armature = {"0.01", "a=0.5"};
  options.damping = {"c=0.2"};
  options.sites = {"tip=link_c,0.1,0,-2", "x=base"};
  EXPECT_EQ(complaint([&] { apply(options, model); }), "nothing");
  EXPECT_EQ(std::get<Frequency>(model.couplings[0].softness).rad_per_s, 10.0);
  EXPECT_EQ(std::get<Frequency>(model.couplings[1].softness).rad_per_s, 30.0);
  EXPECT_EQ(model.joints[0].armature, 0.5);
  EXPECT_EQ(model.joints[1].armature, 0.01);
  EXPECT_EQ(model.joints[3].armature, 0.0);
  EXPECT_EQ(model.joints[2].damping, 0.2);
  EXPECT_EQ(model.joints[1].damping, 0.0);
  EXPECT_EQ(model.sites[0].link, "link_c");
  EXPECT_EQ(model.sites[0].pose.translation(), Eigen::Vector3d(0.1, 0, -2));
  for (const char* wrong : {"tip", "=base", "tip=", "tip=base,1", "tip=base,1,2,x"}) {
    options.sites = {wrong};
    EXPECT_NE(complaint([&] { apply(options, model); }).find("--site"), std::string::npos) << wrong;
  }
}

TEST(Options, float_the_root_as_the_file_says_unless_told) {
  for (const bool in_file : {false, true})
    for (const std::optional<bool>& told : {std::optional<bool>(), {false}, {true}}) {
      Model model = chain();
      model.roots = {{model.links[0].name, in_file}};
      ModelOptions options;
      options.floating = told;
      apply(options, model);
      EXPECT_EQ(model.roots[0].floating, told.value_or(in_file));
    }
}

TEST(Options, reach_the_second_coupling_of_a_joint) {
  Model model = chain();
  model.couplings.push_back(Coupling::mimic("b", "d", 1.0));
  ModelOptions options;
  options.softness = {"b#2=1,2"};
  options.force_limits = {"b#2=3"};
  apply(options, model);
  EXPECT_TRUE(is_hard(model.couplings[0].softness));
  EXPECT_EQ(std::get<Frequency>(model.couplings[2].softness).rad_per_s, 1.0);
  EXPECT_EQ(model.couplings[0].force_limit, infinity);
  EXPECT_EQ(model.couplings[2].force_limit, 3.0);
}

TEST(Options, name_what_is_unknown) {
  const auto refused = [](const char* softness, const char* drive) {
    ModelOptions options;
    if (*softness) options.softness = {softness};
    if (*drive) options.drives = {drive};
    Model model = chain();
    return complaint([&] { apply(options, model); });
  };
  EXPECT_EQ(refused("x=1,2", ""), "--softness: no coupling has 'x' as its first joint; the couplings are: b, c");
  EXPECT_EQ(refused("b=1", ""), "--softness b: '1' should be 2 numbers separated by commas");
  EXPECT_EQ(refused("b", ""), "--softness all: 'b' should be 2 numbers separated by commas");
  EXPECT_EQ(refused("", "x=1,2"), "--drive: model 'chain' has no joint 'x'; its moving joints are: a, b, c, d");
  EXPECT_EQ(refused("", "a=-1,2"), "--drive a: 'a=-1,2' is negative");
  EXPECT_EQ(complaint([] { method_of("fast"); }),
            "--method: there is no 'fast'; the methods are automatic, pgs, tgs, direct, reduced");
  EXPECT_EQ(complaint([] { engine_of("fast"); }),
            "--engine: there is no 'fast'; the engines are automatic, tables, compiled, generated");
  for (const Engine engine : {Engine::automatic, Engine::tables, Engine::compiled, Engine::generated})
    EXPECT_EQ(engine_of(to_string(engine)), engine);
}

TEST(Options, name_what_is_unknown_about_bounds) {
  const auto refused = [](auto option, const char* text, const char* gains = "b=0,0") {
    Model model = chain();
    model.joints[3].kind = JointKind::fixed;
    ModelOptions options;
    options.*option = {text};
    options.drives = {gains};
    return complaint([&] { apply(options, model); });
  };
  const auto force = &ModelOptions::force_limits, kinematic = &ModelOptions::kinematic;
  EXPECT_EQ(refused(force, "d=1"), "--force-limit: no coupling has 'd' as its first joint; the couplings are: b, c");
  EXPECT_EQ(refused(force, "b"), "--force-limit: 'b' should be JOINT=NUMBER");
  EXPECT_EQ(refused(force, "b=1,2"), "--force-limit b: '1,2' should be one number");
  EXPECT_EQ(refused(force, "b=-1"), "--force-limit b: 'b=-1' is negative");
  EXPECT_EQ(refused(kinematic, "x"), "--kinematic: model 'chain' has no joint 'x'; its moving joints are: a, b, c");
  EXPECT_EQ(refused(kinematic, "d"), "--kinematic: joint 'd' is fixed; name a moving one");
  EXPECT_EQ(
      refused(kinematic, "a", "a=1,1"),
      "--kinematic: joint 'a' has a --drive or a servo of its file, too; set --drive a=0,0 to take it away, or leave "
      "out --kinematic");
}

TEST(Targets, are_for_joints_with_a_drive_of_either_kind) {
  Model model = chain();
  const Table table = parse_csv("time,a\n0,0.5\n", "t.csv");
  EXPECT_EQ(complaint([&] { Targets(table, compile(model)); }),
            "t.csv:1:2: joint 'a' has no drive that could follow a target; give it one with --drive or --kinematic");
  model.joints[0].drive.kinematic = true;
  EXPECT_EQ(complaint([&] { Targets(table, compile(model)); }), "nothing");
}

TEST(States, columns_of_joints_must_differ) {
  Model model = chain();
  EXPECT_EQ(state_columns(compile(model))[3].name, "b.v");
  model.joints[1].name = "a.v";
  model.couplings.clear();
  EXPECT_EQ(complaint([&] { state_columns(compile(model)); }),
            "joint 'a' and joint 'a.v' both claim the column 'a.v'; rename one of them");
}

// Two boxes that float: each has its link's name. One alone is `root`.
TEST(States, of_several_floating_roots_have_the_names_of_their_links) {
  const Inertia box = Inertia::box(1.0, {0.1, 0.2, 0.3}, {0, 0, 0});
  Model model;
  model.links = {{"cup", box}, {"ball", box}};
  model.roots = {{"ball", true}, {"cup", true}};
  const std::vector<StateColumn> columns = state_columns(compile(model));
  ASSERT_EQ(columns.size(), 26u);
  EXPECT_EQ(columns[0].name, "ball.x");
  EXPECT_EQ(columns[9].name, "cup.z");
  EXPECT_EQ(columns[25].name, "cup.vz");
  const Model moved =
      with_state(model, parse_csv("cup.z,cup.vx,ball.qw,ball.qx,ball.qy,ball.qz\n2,0.5,0,1,0,0\n", "s.csv"));
  EXPECT_EQ(moved.roots[1].pose.translation().z(), 2.0);
  EXPECT_EQ(moved.roots[1].velocity[3], 0.5);
  EXPECT_EQ(moved.roots[0].pose.linear()(2, 2), -1.0);
  EXPECT_EQ(complaint([&] { with_state(model, parse_csv("cup.qw\n1\n", "s.csv")); }),
            "s.csv:1: give all four of cup.qw, cup.qx, cup.qy, cup.qz or none");
  model.links.pop_back(), model.roots = {{"cup", true}};
  EXPECT_EQ(state_columns(compile(model))[0].name, "root.x");
}

// The range of a follower, seen from its leader: b = 2 a - 0.1 within -0.5 to 0.3 leaves a -0.2 to 0.2.
TEST(Ranges, of_leaders_are_narrowed_by_those_of_followers) {
  Model model = chain();
  model.joints[0].lower = -1.0, model.joints[0].upper = 0.15;
  model.joints[1].lower = -0.5, model.joints[1].upper = 0.3;
  model.joints[3].upper = 2.0;
  const std::vector<Range> usable = usable_ranges(compile(model));
  EXPECT_NEAR(usable[0].lower, -0.2, 1e-15);
  EXPECT_EQ(usable[0].lower_by, "b");
  EXPECT_EQ(usable[0].upper, 0.15);
  EXPECT_EQ(usable[0].upper_by, "");
  EXPECT_EQ(usable[3].lower, -infinity);
  EXPECT_EQ(usable[3].upper, 2.0);
  EXPECT_EQ(usable_ranges(compile(model, {.ignore = {.position_limits = {"b"}}}))[0].lower, -1.0);
}

TEST(Noise, leaves_no_joint_beyond_its_range) {
  Model model = chain();
  model.joints[0].lower = 0.0, model.joints[0].upper = 0.15;  // it starts at its end
  model.joints[1].lower = -0.5, model.joints[1].upper = 0.1;  // leaves a 0.1
  model.joints[2].lower = -0.1;                               // c = -b / 2
  model.couplings.push_back({"d", {{"a", 1.0}, {"c", 1.0}}, 0.0, {}, infinity});
  model.joints[3].lower = -0.06;
  const Plan plan = compile(model);
  Batch<double> batch(plan, 200, {.threads = 1});
  perturb(0.3, 5, batch);
  EXPECT_LE(batch.coupling_errors().abs().maxCoeff(), 1e-14);
  EXPECT_LE(batch.limit_violations().maxCoeff(), 1e-5);
  EXPECT_GT(batch.positions().row(0).maxCoeff(), 0.05);
  Batch<double> fewer(plan, 20, {.threads = 1});
  perturb(0.3, 5, fewer);
  EXPECT_TRUE((fewer.positions() == batch.positions().leftCols(20)).all());
}

TEST(Chart, start_moves_within_the_limits_and_keeps_the_couplings) {
  Model model = chain();
  model.joints[0].upper = 0.1, model.joints[3].kind = JointKind::prismatic;
  const Model started = with_moving_start(model);
  EXPECT_DOUBLE_EQ(started.joints[0].position, -0.3);  // downwards, where there is more room
  EXPECT_DOUBLE_EQ(started.joints[0].velocity, 1.0);
  EXPECT_NEAR(started.joints[1].velocity, 2.0, 1e-14);
  EXPECT_DOUBLE_EQ(started.joints[3].position, 0.03);
  Eigen::VectorXd q(4);
  for (int i = 0; i < 4; ++i) q[i] = started.joints[i].position;
  EXPECT_LT(errors(model, q).norm(), 1e-14);

  model.joints[2].velocity = 0.1;  // a model that moves keeps its start
  EXPECT_EQ(with_moving_start(model).joints[0].position, 0.0);
}

TEST(Chart, compares_all_methods_for_models_with_couplings) {
  EXPECT_EQ(chart_settings(chain()).size(), 5u * (2 + 2 + 6 + 6 + 6));
  Model model = chain();
  model.couplings.clear();
  for (const ChartSetting& setting : chart_settings(model))
    EXPECT_TRUE(setting.method == Method::direct || setting.integrator != Integrator::euler);
}

TEST(Chart, ignores_the_same_bounds_in_every_run) {
  for (const ChartSetting& setting : chart_settings(chain(), {.velocity_limits = true, .friction = true})) {
    const Ignored ignore = compile_setting(chain(), setting).settings().ignore;
    EXPECT_TRUE(ignore.velocity_limits.all && ignore.friction.all);
    EXPECT_TRUE(ignore.position_limits.empty() && ignore.effort_limits.empty());
  }
}

TEST(Processes, report_how_they_end) {
  const ProcessResult result = run_process({"/bin/sh", "-c", "echo \"$0\" >&2; exit 3", "a 'b\" c"});
  EXPECT_EQ(result.status, 3);
  EXPECT_EQ(result.errors, "a 'b\" c\n");
  EXPECT_EQ(run_process({"/no/such/program"}).status, 127);
  EXPECT_EQ(run_process({"/bin/sh", "-c", "kill -9 $$"}).status, 128 + 9);
  EXPECT_FALSE(find_python("/no/such/python"));
}

}  // namespace
}  // namespace lockstep::tool
