// Outputs that cannot be written, pipes, numbers that are none, and files that Python would run.
// SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>

#include <cstdlib>

#include "command.h"

namespace lockstep::tool {
namespace {

class Hostile : public Command {
 protected:
  // Runs a line of the shell in the test's folder; $L is the command, $M a model.
  int shell(const std::string& line) const {
    setenv("L", LOCKSTEP_COMMAND, 1), setenv("M", model.c_str(), 1), setenv("F", folder_.c_str(), 1);
    const int status = std::system(("cd \"$F\" && timeout 60 sh -c '" + line + "' >>log 2>>errors").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
};

const char* const commands[] = {"info \"$M\"",
                                "simulate \"$M\" --envs 1 --seconds 0.01",
                                "view \"$M\" --seconds 0.01 --out v.html",
                                "export \"$M\" --out e.xml",
                                "generate \"$M\" --out g.cpp",
                                "chart \"$M\" --seconds 0.01 --budget 0.01 --out c.svg",
                                "--help",
                                "--version"};

TEST_F(Hostile, output_that_cannot_be_written_is_an_error) {
  for (const std::string command : commands) {
    EXPECT_EQ(shell("\"$L\" " + command), 0) << command << contents(path("errors"));
    for (const char* output : {"> /dev/full", ">&-"}) {
      write("errors", "");
      EXPECT_EQ(shell("\"$L\" " + command + " " + output), 2) << command << output;
      EXPECT_NE(contents(path("errors")).find("standard output cannot be written"), std::string::npos) << command;
    }
  }
}

TEST_F(Hostile, errors_that_cannot_be_written_change_no_exit_code) {
  for (const char* output : {"2> /dev/full", "2>&-", ">&- 2>&-"}) {
    EXPECT_EQ(shell(std::string("\"$L\" info nothing.urdf ") + output), 2) << output;
    EXPECT_EQ(shell(std::string("\"$L\" simulate \"$M\" --envs x ") + output), 2) << output;
  }
  EXPECT_EQ(shell("\"$L\" export \"$M\" --out a.xml 2>&- && test -s a.xml"), 0);
}

// The descriptor of a closed output is free for the next file, which must not get what is printed.
TEST_F(Hostile, files_do_not_get_what_is_printed) {
  const std::string record = "\"$L\" simulate \"$M\" --envs 1 --seconds 0.1 --record ";
  EXPECT_EQ(shell(record + "open.csv"), 0);
  EXPECT_EQ(shell(record + "closed.csv <&- >&- 2>&-"), 2);
  EXPECT_EQ(contents(path("open.csv")), contents(path("closed.csv")));
}

TEST_F(Hostile, no_pipe_is_waited_for) {
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  for (const std::string arguments :
       {"info pipe", "simulate pipe", "simulate \"$M\" --state pipe", "chart \"$M\" --state pipe",
        "simulate \"$M\" --targets pipe --drive wrist=1,1", "view \"$M\" --record pipe",
        "simulate \"$M\" --seconds 0.01 --record pipe", "simulate \"$M\" --seconds 0.01 --json pipe",
        "chart \"$M\" --seconds 0.01 --budget 0.01 --csv pipe", "chart \"$M\" --seconds 0.01 --budget 0.01 --out pipe",
        "view \"$M\" --seconds 0.01 --out pipe", "generate \"$M\" --out pipe",
        "export \"$M\" --format mjcf --out pipe"}) {
    write("errors", "");
    EXPECT_EQ(shell("\"$L\" " + arguments), 2) << arguments;
    EXPECT_NE(contents(path("errors")).find("pipe"), std::string::npos) << arguments << contents(path("errors"));
  }
  EXPECT_EQ(
      shell("cat pipe >copy & \"$L\" simulate \"$M\" --seconds 0.01 --record pipe; status=$?; wait; exit $status"), 0);
  EXPECT_TRUE(contents(path("copy")).starts_with("time,"));
}

TEST_F(Hostile, numbers_of_options_are_finite_and_in_their_range) {
  const std::pair<const char*, Arguments> options[] = {
      {"simulate",
       {"--perturb", "--tolerance", "--seed", "--dt", "--guard", "--seconds", "--erp", "--density", "--least-mass",
        "--least-inertia", "--ground", "--envs", "--threads", "--iterations"}},
      {"view", {"--rate", "--perturb", "--environments"}},
      {"chart", {"--budget", "--envs", "--seconds"}},
      {"export", {"--timestep"}}};
  for (const auto& [command, names] : options)
    for (const std::string& name : names)
      for (const std::string number : {"nan", "-inf", "1e400", "-1", "0x1p3", ""}) {
        Arguments arguments = {command, model, name + "=" + number};
        if (std::string_view(command) == "export") arguments.insert(arguments.end(), {"--out", path("e.xml")});
        const Ran ran = run(arguments);
        EXPECT_EQ(ran.status, 2) << command << " " << name << " " << number;
      }
  EXPECT_EQ(run({"info", model, "--dt", "1e-320"}).status, 2);
  EXPECT_EQ(run({"info", model, "--guard", "inf"}).status, 0);
  EXPECT_EQ(run({"simulate", model, "--envs", "1", "--seconds", "0.01", "--seed", "18446744073709551615"}).status, 0);
}

// Python looks for modules in the current folder first, unless it is told not to.
TEST_F(Hostile, nothing_of_the_current_folder_is_run) {
  for (const char* module : {"matplotlib", "numpy", "csv", "json"})
    write(module + std::string(".py"), "open('EXECUTED', 'w')\n");
  shell("PYTHONPATH=. \"$L\" chart \"$M\" --seconds 0.01 --budget 0.01 --out c.svg");
  EXPECT_FALSE(std::filesystem::exists(path("EXECUTED")));
}

// A file by any of its names, and what the model's file names.
TEST_F(Hostile, no_output_replaces_what_the_model_was_read_from) {
  const std::string mesh =
      "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
      "endfacet\nfacet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\n"
      "endfacet\nfacet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 1 0 0\nendloop\n"
      "endfacet\nfacet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\n"
      "endfacet\nendsolid s\n";
  const std::string stl = write("part.stl", mesh);
  const std::string part = write("part.xml", "<mujoco><option timestep='0.01'/></mujoco>");
  const std::string own =
      write("own.xml",
            "<mujoco><include file='part.xml'/><asset><mesh name='m' file='part.stl'/></asset><worldbody>"
            "<body name='a'><joint name='j'/><geom type='mesh' mesh='m'/></body></worldbody></mujoco>");
  std::filesystem::create_hard_link(own, path("twin.xml"));
  const std::string before = contents(own), part_before = contents(part);
  for (const std::string& out : {stl, part, path("twin.xml"), own}) {
    const Ran ran = run({"export", own, "--format", "mjcf", "--out", out});
    EXPECT_EQ(ran.status, 2) << out;
    EXPECT_NE(ran.err.find("would be overwritten"), std::string::npos) << ran.err;
    EXPECT_EQ(run({"simulate", own, "--seconds", "0.01", "--record", out}).status, 2) << out;
  }
  EXPECT_EQ(contents(stl), mesh);
  EXPECT_EQ(contents(part), part_before);
  EXPECT_EQ(contents(own), before);
  EXPECT_EQ(run({"export", own, "--format", "mjcf", "--out", path("other.xml")}).status, 0);
}

}  // namespace
}  // namespace lockstep::tool
