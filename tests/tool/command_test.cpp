// The built command as a user runs it: exit codes, messages, states, trajectories. SPDX-License-Identifier: Apache-2.0
#include "command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tool/csv.h"

namespace lockstep::tool {
namespace {

TEST_F(Command, prints_help_without_error) {
  for (const Arguments& arguments :
       {Arguments{"--help"}, {"--version"}, {"info", "--help"}, {"simulate", "--help"}, {"chart", "--help"}}) {
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 0);
    EXPECT_FALSE(ran.out.empty());
    EXPECT_TRUE(ran.err.empty()) << ran.err;
  }
}

TEST_F(Command, info_says_what_the_file_holds_and_what_a_step_does) {
  const Ran ran = run({"info", model, "--method", "tgs", "--dt", "1/480"});
  EXPECT_EQ(ran.status, 0) << ran.err;
  EXPECT_NE(ran.out.find("tgs"), std::string::npos) << ran.out;
  EXPECT_GT(lines(ran.out).size(), 3u);
}

TEST_F(Command, takes_contact_settings_by_name) {
  for (const auto& [name, solve] : {std::pair("learning", "at most 2 passes of 30 rounds, tolerance 0.01."),
                                    {"default", "at most 3 passes of 30 rounds, tolerance 0.0001."},
                                    {"accurate", "at most 10 passes of 30 rounds, tolerance 0.0001."}}) {
    const Ran ran =
        run({"info", LOCKSTEP_MODELS "/arm_gripper.urdf", "--contact", "left_tip,box", "--contact-settings", name});
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_NE(ran.out.find(solve), std::string::npos) << ran.out;
  }
}

TEST_F(Command, refuses_bad_input_with_one_line_and_exit_code_2) {
  const std::string unknown_column = write("unknown.csv", "shoulder,knee\n1,2\n");
  const std::string no_number = write("letters.csv", "shoulder,wrist\n1,2\n1,x\n");
  const std::string two_rows = write("two.csv", "shoulder\n1\n2\n");
  const std::string one = write("one.csv", "shoulder\n1\n");
  const std::string backwards = write("backwards.csv", "time,wrist\n1,0\n0.5,0\n");
  const std::string no_time = write("timeless.csv", "wrist\n1\n");
  const std::string utf16 = write("utf16.csv", std::string("s\0h\0\n\0"
                                                           "0\0\n\0",
                                                           10));
  const std::string times_alone = write("alone.csv", "time\n0\n");
  const std::string undriven = write("undriven.csv", "time,wrist\n0,1\n");
  const std::string no_urdf = write("text.urdf", "hello");
  const std::string clocked =
      write("clocked.xml",
            "<mujoco><worldbody><body name='a'><joint name='time'/><geom size='0.1'/></body></worldbody></mujoco>");
  const struct {
    Arguments arguments;
    const char* said;
  } cases[] = {
      {{}, "info, simulate, chart, view, generate or export"},
      {{"simulat", model}, "'simulat'"},
      {{"--fast"}, "'--fast'"},
      {{"simulate"}, "MODEL"},
      {{"simulate", model, "--hurry"}, "--hurry"},
      {{"simulate", "/no/such.urdf"}, "/no/such.urdf"},
      {{"simulate", no_urdf}, "text.urdf"},
      {{"info", "/no/such.urdf"}, "/no/such.urdf"},
      {{"chart", "/no/such.urdf"}, "/no/such.urdf"},
      {{"simulate", model, "--envs", "0"}, "--envs"},
      {{"simulate", model, "--envs", "many"}, "--envs"},
      {{"simulate", model, "--iterations", "1001"}, "--iterations"},
      {{"simulate", model, "--velocity-iterations", "-1"}, "--velocity-iterations"},
      {{"simulate", model, "--threads", "-1"}, "--threads"},
      {{"simulate", model, "--dt", "0"}, "--dt"},
      {{"simulate", model, "--dt", "1/0"}, "--dt"},
      {{"simulate", model, "--seconds", "soon"}, "--seconds"},
      {{"simulate", model, "--seconds", "0.001"}, "less than half a step"},
      {{"simulate", model, "--method", "magic"}, "automatic, pgs, tgs, direct, reduced"},
      {{"simulate", model, "--contact-settings", "quick"}, "the contact settings are learning, default, accurate"},
      {{"simulate", model, "--precision", "f16"}, "f32 or f64"},
      {{"simulate", model, "--engine", "fast"}, "the engines are automatic, tables, compiled, generated"},
      {{"simulate", model, "--engine", "generated"}, "add one by lockstep_add_kernel()"},
      {{"simulate", model, "--gravity", "0,0"}, "--gravity"},
      {{"simulate", model, "--fixed-base", "--floating-base"}, "base"},
      {{"simulate", model, "--softness", "knee=1,2"}, "knee"},
      {{"simulate", model, "--drive", "knee=1,2"}, "knee"},
      {{"simulate", model, "--drive", "wrist=1"}, "wrist"},
      {{"simulate", model, "--kinematic", "knee"}, "knee"},
      {{"simulate", model, "--kinematic", "wrist", "--drive", "wrist=1,1"}, "--kinematic"},
      {{"simulate", model, "--force-limit", "wrist=1"}, "the couplings are: elbow, slide"},
      {{"simulate", model, "--force-limit", "slide=0"}, "force limit is 0"},
      {{"info", model, "--ignore", "gravity"}, "position_limits,velocity_limits,effort_limits,friction"},
      {{"chart", model, "--ignore", "gravity"}, "position_limits,velocity_limits,effort_limits,friction"},
      {{"simulate", model, "--perturb", "-1"}, "--perturb"},
      {{"simulate", model, "--record-env", "1024"}, "--record-env"},
      {{"simulate", model, "--record", "/no/such/folder/r.csv"}, "/no/such/folder/r.csv"},
      {{"simulate", model, "--json", "/no/such/folder/r.json"}, "/no/such/folder/r.json"},
      {{"simulate", model, "--state", "/no/such.csv"}, "/no/such.csv"},
      {{"simulate", model, "--state", "/dev/zero"}, "/dev/zero: is no regular file"},
      {{"simulate", model, "--targets", "/dev/zero", "--drive", "wrist=1,1"}, "/dev/zero: is no regular file"},
      {{"simulate", model, "--ignore", "position_limits:knee"}, "names 'knee', which is no moving joint"},
      {{"simulate", model, "--armature", "knee=1"}, "--armature: model 'linkage' has no joint 'knee'"},
      {{"simulate", model, "--site", "tip=nowhere"}, "nowhere"},
      {{"simulate", model, "--state", unknown_column}, "unknown.csv:1:2"},
      {{"simulate", model, "--state", no_number}, "letters.csv:3:2"},
      {{"simulate", model, "--envs", "3", "--state", two_rows}, "2 rows for 3 environments"},
      {{"simulate", model, "--targets", backwards, "--drive", "wrist=1,1"}, "backwards.csv:3:1"},
      {{"simulate", model, "--targets", no_time, "--drive", "wrist=1,1"}, "no column 'time'"},
      {{"simulate", model, "--targets", times_alone, "--drive", "wrist=1,1"}, "has times and no targets"},
      {{"simulate", model, "--targets", undriven}, "has no drive"},
      {{"simulate", model, "--state", one, "--record", one}, "would be overwritten"},
      {{"simulate", model, "--record", path("same"), "--json", path("same")}, "would be overwritten"},
      {{"chart", model, "--out", path("same.csv")}, "would be overwritten"},
      {{"chart", model, "--out", path("moving.gif")}, "is no picture"},
      {{"simulate", model, "--record", std::string(300, 'x')}, "cannot be written"},
      {{"simulate", model, "--state", utf16}, "holds zero bytes"},
      {{"chart", model, "--state", one, "--out", path("one.svg")}, "would be overwritten"},
      {{"simulate", model, "--drive", "wrist=1,1", "--drive", "wrist=2,1"}, "--drive: is given twice for 'wrist'"},
      {{"simulate", model, "--damping", "1", "--damping", "2"}, "--damping: is given twice for all"},
      {{"simulate", clocked, "--seconds", "0.01", "--record", path("r.csv")}, "both claim the column 'time'"},
      {{"simulate", clocked, "--site", "j.x=a", "--site", "j=a", "--record", path("r.csv")}, "claim the column"},
  };
  for (const auto& [arguments, said] : cases) {
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 2) << said;
    expect_one_complaint(ran.err, said);
    EXPECT_TRUE(ran.out.empty()) << ran.out;
  }
  const Ran both = run({"simulate", model, "--erp", "2"});  // a line for each of the couplings
  EXPECT_EQ(both.status, 2);
  ASSERT_EQ(lines(both.err).size(), 2u) << both.err;
  for (const std::string& line : lines(both.err)) EXPECT_NE(line.find("erp"), std::string::npos) << line;
}

TEST_F(Command, record_has_the_documented_columns_and_a_row_per_step) {
  const std::vector<std::string> rows = lines(recorded({"--seconds", "0.1", "--dt", "1/60"}));
  ASSERT_EQ(rows.size(), 1u + 1 + 6);
  EXPECT_EQ(rows[0], "time,shoulder,shoulder.v,elbow,elbow.v,wrist,wrist.v,slide,slide.v,C.elbow,C.slide,fault");
  EXPECT_TRUE(rows[1].starts_with("0,0,0,0,0,0,0,"));
  recorded({"--floating-base", "--seconds", "0.1"}, "floating.csv");
  const Table table = read_csv(path("floating.csv"));
  ASSERT_EQ(table.columns.size(), 11u + 13 + 1);
  EXPECT_EQ(table.columns[11], "root.x");
  EXPECT_EQ(table.columns[14], "root.qw");
  EXPECT_EQ(table.columns[23], "root.vz");
  EXPECT_EQ(table.rows[0][14], 1.0);
}

// A recorded row, used as the start, has the same bits: the runs coincide from there on.
TEST_F(Command, record_reads_back_to_the_same_bits) {
  for (const Arguments& how : {Arguments{}, {"--precision", "f64"}, {"--floating-base"}, {"--method", "pgs"}}) {
    Arguments first = how, second = how;
    first.insert(first.end(), {"--seconds", "40/240", "--perturb", "0.3"});
    const std::vector<std::string> rows = lines(recorded(first));
    std::istringstream header(rows[0]), row(rows[1 + 25]);
    std::string state_header, state_row;
    for (std::string name, number; std::getline(header, name, ',') && std::getline(row, number, ',');) {
      if (name == "time" || name == "fault" || name.starts_with("C.")) continue;
      state_header += (state_header.empty() ? "" : ",") + name;
      state_row += (state_row.empty() ? "" : ",") + number;
    }
    const std::string state = write("state.csv", state_header + "\n" + state_row);
    second.insert(second.end(), {"--seconds", "15/240", "--state", state});
    const std::vector<std::string> continued = lines(recorded(second));
    ASSERT_EQ(continued.size(), 1u + 1 + 15);
    for (int i = 0; i <= 15; ++i) {
      const std::string &was = rows[1 + 25 + i], &is = continued[1 + i];
      EXPECT_EQ(was.substr(was.find(',')), is.substr(is.find(','))) << "step " << i;
    }
  }
}

TEST_F(Command, state_has_one_row_for_all_or_one_for_each) {
  const std::string one = write("one.csv", "wrist,wrist.v\n0.25,-1\n");
  std::string text = "wrist.v,wrist\n";
  for (int e = 0; e < 9; ++e) text += "0," + std::to_string(e) + "\n";
  const std::string each = write("each.csv", text);
  recorded({"--state", one, "--record-env", "7"});
  Table table = read_csv(path("record.csv"));
  EXPECT_EQ(table.rows[0][5], 0.25);
  EXPECT_EQ(table.rows[0][6], -1.0);
  EXPECT_EQ(table.rows[0][1], 0.0);  // has no column: the model's value
  recorded({"--state", each, "--record-env", "7"});
  table = read_csv(path("record.csv"));
  EXPECT_EQ(table.rows[0][5], 7.0);
}

// A start with leaders alone: slide = 0.05 wrist + 0.01 and elbow = -shoulder.
TEST_F(Command, state_places_followers_that_have_no_column) {
  const std::string leaders = write("leaders.csv", "shoulder,wrist,wrist.v\n0.3,-0.4,2\n");
  for (const char* method : {"automatic", "pgs"}) {
    recorded({"--state", leaders, "--precision", "f64", "--method", method});
    const Table table = read_csv(path("record.csv"));
    EXPECT_DOUBLE_EQ(table.rows[0][3], -0.3);
    EXPECT_DOUBLE_EQ(table.rows[0][7], 0.05 * -0.4 + 0.01);
    EXPECT_DOUBLE_EQ(table.rows[0][8], 0.05 * 2);
  }
  // Soft couplings start at rest, too. A column that the file has stays, even if it breaks the coupling.
  recorded({"--state", write("both.csv", "shoulder,slide\n0.3,0.05\n"), "--softness", "20,1"});
  const Table table = read_csv(path("record.csv"));
  EXPECT_NEAR(table.rows[0][3], -0.3, 1e-7);
  EXPECT_NEAR(table.rows[0][7], 0.05, 1e-8);
}

// A free fall of 1 s from 3 m: 3 - g / 2, and half a step's more by Euler's rule.
TEST_F(Command, floats_a_robot_that_its_file_floats) {
  const std::string hull = write("hull.urdf", R"(<robot name="hull"><link name="world"/><link name="hull"><inertial>
    <mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
    <joint name="free" type="floating"><parent link="world"/><child link="hull"/><origin xyz="1 2 3"/></joint>
    </robot>)");
  const auto height_after = [&](Arguments arguments) {
    arguments.insert(arguments.begin(), {"simulate", hull, "--envs", "1", "--record", path("r.csv")});
    EXPECT_EQ(run(arguments).status, 0);
    const Table table = read_csv(path("r.csv"));
    const auto z = std::find(table.columns.begin(), table.columns.end(), "root.z") - table.columns.begin();
    return z < static_cast<long>(table.columns.size()) ? table.rows.back()[z] : std::nan("");
  };
  EXPECT_NEAR(height_after({}), 3.0 - 9.81 / 2.0, 0.03);
  EXPECT_TRUE(std::isnan(height_after({"--fixed-base"})));
  EXPECT_NE(simulate({}).out.find("fixed base"), std::string::npos);  // a file that floats nothing
}

TEST_F(Command, keeps_results_of_a_run_before_that_it_cannot_replace) {
  const std::string json = write("r.json", "old json"), record = write("r.csv", "old record"),
                    massless = write("massless.urdf",
                                     R"(<robot name="m"><link name="a"/><link name="b"/><joint name="j"
    type="continuous"><parent link="a"/><child link="b"/></joint></robot>)");
  for (const Arguments& arguments :
       {Arguments{massless}, {model, "--drive", "knee=1,1"}, {model, "--state", "/no/such.csv"}}) {
    Arguments all = {"simulate", "--json", json, "--record", record};
    all.insert(all.end(), arguments.begin(), arguments.end());
    EXPECT_EQ(run(all).status, 2);
    EXPECT_EQ(contents(json), "old json");
    EXPECT_EQ(contents(record), "old record");
  }
  const std::string table = write("c.csv", "old table");
  EXPECT_EQ(run({"chart", massless, "--csv", table}).status, 2);
  EXPECT_EQ(contents(table), "old table");
}

// The wrong sign of a mimic's range leaves its leader nothing, unless the followers' ranges are ignored.
TEST_F(Command, ignores_bounds_by_joint_and_names_what_followers_leave) {
  const auto finger = [](const char* name) {
    return fmt::format(R"(<link name="{0}"><inertial><mass value="0.05"/><inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5"
      iyz="0" izz="1e-5"/></inertial></link><joint name="{0}" type="prismatic"><parent link="palm"/><child link="{0}"/>
      <axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="50" velocity="0.5"/>)",
                       name);
  };
  const std::string jaws = write("jaws.urdf", "<robot name='jaws'><link name='palm'/>" + finger("fa") + "</joint>" +
                                                  finger("fb") + "<mimic joint='fa' multiplier='-1'/></joint></robot>");
  const std::string targets = write("t.csv", "time,fa\n0,0.03\n");
  const auto reached = [&](Arguments arguments) {
    arguments.insert(arguments.begin(), {"simulate", jaws, "--envs", "3", "--seconds", "2", "--drive", "fa=500,10",
                                         "--targets", targets, "--record", path("r.csv")});
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.status, 0) << ran.err;
    return read_csv(path("r.csv")).rows.back()[1];
  };
  EXPECT_NEAR(reached({}), 0.0, 1e-5);
  EXPECT_NEAR(reached({"--ignore", "position_limits:followers"}), 0.03, 1e-4);
  EXPECT_NEAR(reached({"--ignore", "velocity_limits,position_limits:fb"}), 0.03, 1e-4);
  EXPECT_NEAR(reached({"--ignore", "position_limits:fa"}), 0.0, 1e-5);
  const std::string info = run({"info", jaws, "--drive", "fa=500,10"}).out;
  EXPECT_NE(info.find("fa: prismatic, 0 to 0.04 m, 0.5 m/s, 50 N, servo kp 500 kd 10; followers leave 0 m alone (fb)"),
            std::string::npos)
      << info;
  EXPECT_NE(info.find("fb: prismatic, 0 to 0.04 m, 0.5 m/s, 50 N; follows -1 fa"), std::string::npos) << info;
  EXPECT_NE(run({"info", jaws, "--ignore", "position_limits:followers"}).out.find("0 to 0.04 m (ignored)"),
            std::string::npos);
}

// A leader whose follower leaves it no room, and a link whose inertia is missing.
TEST_F(Command, prints_warnings_of_the_import_in_every_command) {
  const std::string limits = "<limit lower='0' upper='1' effort='5' velocity='5'/>";
  const std::string box = "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>";
  const auto joint = [](const std::string& name, const std::string& child, const std::string& inside) {
    return "<joint name='" + name + "' type='revolute'><parent link='base'/><child link='" + child + "'/>" + inside +
           "</joint>";
  };
  const std::string file =
      write("locked.urdf", "<robot name='r'><link name='base'/><link name='a'>" + box + "</link>\n<link name='b'>" +
                               box + "</link>" + joint("lead", "a", limits) +
                               joint("back", "b", limits + "<mimic joint='lead' multiplier='-1'/>") + "</robot>");
  const Ran refused = run({"info", file});
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.err.find("locked.urdf:1: link 'a'"), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("the same holds for b"), std::string::npos) << refused.err;
  for (const char* option : {"--density", "--least-mass", "--least-inertia"})
    EXPECT_NE(refused.err.find(option), std::string::npos) << refused.err;
  EXPECT_EQ(refused.err.find("ImportOptions"), std::string::npos) << refused.err;

  const std::string locked = "lockstep: warning: followers whose limits leave their leader no room to move (1): back\n";
  const std::string filled = "lockstep: warning: inertia from collision shapes of 1000 kg/m^3 (2): a, b\n";
  for (const Arguments& command :
       {Arguments{"info", file}, Arguments{"simulate", file, "--envs", "2", "--seconds", "0.01"},
        Arguments{"simulate", file, "--envs", "2", "--seconds", "0.01", "--json", path("r.json")},
        Arguments{"generate", file, "--out", path("kernel.cpp")}}) {
    Arguments all = command;
    all.insert(all.end(), {"--density", "1000"});
    const Ran ran = run(all);
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_NE(ran.err.find(locked), std::string::npos) << command[0] << "\n" << ran.err;
    EXPECT_NE(ran.err.find(filled), std::string::npos) << command[0] << "\n" << ran.err;
  }
  const Ran ignored = run({"info", file, "--density", "1000", "--ignore", "position_limits:followers"});
  EXPECT_EQ(ignored.err.find("no room"), std::string::npos) << ignored.err;
  EXPECT_EQ(run({"info", file, "--armature", "0.1"}).status, 0);
}

TEST_F(Command, exports_both_formats_and_reads_them) {
  const Ran said = run({"export", model, "--drive", "wrist=5,0.1", "--out", path("out.xml")});
  EXPECT_EQ(said.status, 0) << said.err;
  EXPECT_NE(said.out.find("controls of the file, in its order"), std::string::npos) << said.out;
  const Ran lost =
      run({"export", path("out.xml"), "--keyframe", "start", "--out", path("out.txt"), "--format", "urdf"});
  EXPECT_EQ(lost.status, 0) << lost.err;
  EXPECT_NE(lost.err.find("lockstep: warning: drives, left out (1): wrist\n"), std::string::npos) << lost.err;
  for (const char* file : {"out.xml", "out.txt"}) EXPECT_EQ(run({"info", path(file)}).status, 0) << file;
  const std::string before = contents(path("out.xml"));
  EXPECT_EQ(run({"export", model, "--timestep", "1/500", "--out", path("out.xml")}).status, 0);
  EXPECT_NE(contents(path("out.xml")).find("timestep=\"0.002\""), std::string::npos);
  EXPECT_NE(contents(path("out.xml")), before);
  const struct {
    Arguments arguments;
    const char* said;
  } cases[] = {{{"--out", path("out.sdf")}, ".urdf"},
               {{"--out", path("no/such/folder.xml")}, "folder.xml"},
               {{"--out", path("out.xml"), "--format", "sdf"}, "--format"},
               {{"--out", path("out.xml"), "--timestep", "0"}, "--timestep"},
               {{"--out", model}, "linkage.urdf"},
               {{}, "--out"}};
  for (const auto& [arguments, said_then] : cases) {
    Arguments all = {"export", model};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Ran refused = run(all);
    EXPECT_EQ(refused.status, 2) << said_then;
    expect_one_complaint(refused.err, said_then);
  }
}

TEST_F(Command, reads_mjcf_with_its_options) {
  const std::string file = write(
      "pair.xml",
      "<mujoco><option gravity='0 0 -2'/><worldbody><body name='a'><joint name='x' axis='0 1 0'/><geom size='0.1' "
      "pos='0.1 0 0'/></body><body name='b'><joint name='y'/><geom size='0.1'/></body></worldbody><equality><joint "
      "joint1='y' joint2='x'/><connect body1='a' body2='b' anchor='0 0 0'/></equality><keyframe><key name='up' "
      "qpos='0.5 0.5'/></keyframe></mujoco>");
  const Ran whole = run({"info", file});
  EXPECT_EQ(whole.status, 0) << whole.err;
  EXPECT_NE(whole.out.find("1 loop"), std::string::npos) << whole.out;
  const Arguments options = {"--loops", "leave_out", "--soft", "as_in_file", "--keyframe", "up"};
  for (Arguments command : {Arguments{"info", file}, Arguments{"simulate", file, "--envs", "2", "--seconds", "0.01"},
                            Arguments{"generate", file, "--out", path("kernel.cpp")}}) {
    command.insert(command.end(), options.begin(), options.end());
    const Ran ran = run(command);
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_NE(ran.err.find("closed loops, left out on request"), std::string::npos) << ran.err;
  }
  Arguments info = {"info", file, "--body", "b", "--loops", "leave_out"};
  EXPECT_NE(run(info).out.find("1 moving joint"), std::string::npos);
  EXPECT_EQ(run({"info", file, "--loops", "cut"}).status, 2);
  EXPECT_EQ(run({"info", model, "--keyframe", "up"}).status, 2);
}

TEST_F(Command, records_the_place_of_a_site) {
  recorded({"--site", "tip=hand,0.02,0,0.01", "--site", "grip=finger", "--state", write("s.csv", "shoulder\n0\n"),
            "--precision", "f64"});
  const Table table = read_csv(path("record.csv"));
  const auto at = [&](const char* column) {
    return table.rows[0].at(std::find(table.columns.begin(), table.columns.end(), column) - table.columns.begin());
  };
  EXPECT_DOUBLE_EQ(at("site.tip.x"), 0.1 + 0.1 + 0.02);
  EXPECT_DOUBLE_EQ(at("site.tip.z"), 0.01);
  EXPECT_DOUBLE_EQ(at("site.grip.x"), 0.2 + 0.04 + 0.01);  // the slide's offset
}

TEST_F(Command, perturbs_within_the_ranges_of_joints_and_their_followers) {
  const std::string state = write("edge.csv", "wrist\n0.1\n");  // at its upper end
  ASSERT_EQ(run({"simulate", model, "--state", state, "--perturb", "0.5", "--seconds", "1/240", "--json",
                 path("r.json"), "--envs", "64"})
                .status,
            0);
  const auto json = nlohmann::json::parse(contents(path("r.json")));
  EXPECT_LE(json.at("limit_violation_max"), 1e-4);
  EXPECT_EQ(json.at("conflict_count"), 0);
}

TEST_F(Command, state_sets_a_floating_root) {
  const std::string state = write("root.csv", "root.z,root.qw,root.qx,root.qy,root.qz,root.vx\n2,0,0.6,0,0.8,3\n");
  recorded({"--floating-base", "--state", state});
  const Table table = read_csv(path("record.csv"));
  EXPECT_EQ(table.rows[0][13], 2.0);
  EXPECT_NEAR(table.rows[0][15], 0.6, 1e-6);
  EXPECT_EQ(table.rows[0][21], 3.0);
  for (const auto& [text, said] :
       {std::pair("root.qw\n1\n", "all four"), {"root.qw,root.qx,root.qy,root.qz\n1,1,0,0\n", "unit"}}) {
    const Ran ran = run({"simulate", model, "--floating-base", "--state", write("bad.csv", text)});
    EXPECT_EQ(ran.status, 2);
    expect_one_complaint(ran.err, said);
  }
  expect_one_complaint(run({"simulate", model, "--state", state}).err, "root.z");  // a fixed base has no such state
}

}  // namespace
}  // namespace lockstep::tool
