// Every attribute matters: without it the Model or the report is another. SPDX-License-Identifier: Apache-2.0
#include "deletion.h"

namespace lockstep {
namespace {

using std::string;

const std::filesystem::path folder = LOCKSTEP_MJCF;

struct Case {
  const char* model;
  std::set<string> allowed;  // because they say what holds without them
};

void PrintTo(const Case& given, std::ostream* stream) { *stream << given.model; }

class Deletion : public testing::TestWithParam<Case> {};

TEST_P(Deletion, of_any_attribute_changes_the_model_or_the_report) {
  const string text = contents(folder / "models" / (string(GetParam().model) + ".xml"));
  const string key = text.find("<key") != string::npos ? "0" : "";
  EXPECT_EQ(without_effect(text, {.colliders = true, .keyframe = key}), GetParam().allowed);
}

// Numbers that are the default ones, names that a joint or key has without it, and what other attributes override.
INSTANTIATE_TEST_SUITE_P(
    models, Deletion,
    testing::Values(
        Case{"contacts",
             {R"(geom: condim="1")", R"(geom: name="d")", R"(geom: name="post")", R"(geom: name="shown")",
              R"(geom: size="1 1 1")", R"(geom: type="sphere")", R"(pair: condim="3")"}},
        Case{"drives", {R"(general: biasprm="5 -10 -1")"}},
        Case{"frames",
             {R"(geom: group="4")", R"(geom: type="box")", R"(geom: type="sphere")",
              R"(geom: xyaxes="0.2 1 0 -1 0 0.3")", R"(joint: name="hub")", R"(joint: name="spoke")"}},
        Case{"gravcomp", {R"(freejoint: name="balloon")", R"(joint: name="basket")", R"(joint: name="lift")"}},
        Case{"hand",
             {R"(general: biasprm="0 -7 -0.3")", R"(general: gainprm="12")", R"(geom: name="tip")",
              R"(joint: name="left")", R"(joint: name="right")"}},
        Case{"loops", {R"(joint: axis="0 0 1")", R"(weld: relpose="0.1 0.2 0.3 0 0 0 0")"}},
        Case{"functions",
             {R"(body: pos="0 0 0")", R"(joint: name="cubic")", R"(joint: name="quadratic")",
              R"(joint: name="quartic")"}},
        Case{"masses",
             {R"(geom: group="0")", R"(inertial: diaginertia="1 1 1")", R"(joint: axis="0 0 1")", R"(joint: name="a")",
              R"(joint: name="b")", R"(joint: name="c")", R"(joint: name="d")"}},
        Case{"several",
             {R"(body: pos="0 0 1")", R"(body: pos="1 2 0.5")", R"(body: quat="1 0.3 -0.2 0.5")",
              R"(freejoint: name="car")", R"(joint: axis="0 0 1")", R"(joint: name="ball")", R"(joint: name="wheel")",
              R"(joint: pos="5 5 5")"}},
        Case{"tendons",
             {R"(fixed: actuatorfrclimited="true")", R"(fixed: limited="true")", R"(fixed: springlength="3")"}}),
    [](const auto& given) { return string(given.param.model); });

}  // namespace
}  // namespace lockstep
