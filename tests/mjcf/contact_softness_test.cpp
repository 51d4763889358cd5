// What MJCF makes soft rests where it rests in MuJoCo. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "mjcf/worlds.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

Import read(const string& text) { return import_mjcf(text, "test", {.colliders = true}); }

string of_2_kg(const string& geom) {
  return "<body name='b' pos='0 0 0.1'><freejoint/><geom name='b' mass='2' " + geom + "/></body>";
}
string on_ground(const string& geom, const string& option = "cone='elliptic'", const string& ground = "") {
  return world("<geom name='ground' type='plane' size='0 0 1' " + ground + "/>" + of_2_kg(geom),
               "<option " + option + "/>");
}
const string sphere = "type='sphere' size='0.1' ";

Spring spring_of(const Import& import) { return std::get<Spring>(import.model.contacts.at(0).softness.value()); }

// At a constant impedance d: k = K d^2 / ((1 - d) A) and c = B d / ((1 - d) A), with A = 1/2 kg.
TEST(MjcfContactSoftness, is_the_spring_and_the_damper_of_mujoco) {
  const Spring spring = spring_of(read(on_ground(sphere + "priority='1' solref='0.1 0.5' solimp='0.8 0.8 0.01'")));
  const double K = 1.0 / std::pow(0.8 * 0.1 * 0.5, 2), B = 2.0 / (0.8 * 0.1);
  EXPECT_NEAR(spring.kp, K * 0.64 / (0.2 * 0.5), 1e-9 * spring.kp);
  EXPECT_NEAR(spring.kd, B * 0.8 / (0.2 * 0.5), 1e-9 * spring.kd);
  const Spring direct = spring_of(read(on_ground(sphere + "priority='1' solref='-100 -4' solimp='0.8 0.8 0.01'")));
  EXPECT_NEAR(direct.kp, 100.0 / (0.2 * 0.5), 1e-9 * direct.kp);
  EXPECT_NEAR(direct.kd, 4.0 / 0.8 * 0.8 / (0.2 * 0.5), 1e-9 * direct.kd);
}

TEST(MjcfContactSoftness, has_time_constants_of_at_least_two_steps_unless_the_file_says_so) {
  const string fast = sphere + "priority='1' solref='0.001 1' solimp='0.8 0.8 0.01'";
  const double K = 0.64 / (0.64 * 0.2 * 0.5);
  EXPECT_NEAR(spring_of(read(on_ground(fast))).kp, K / (0.004 * 0.004), 1e-6 * K / (0.004 * 0.004));
  EXPECT_NEAR(spring_of(read(on_ground(fast, "cone='elliptic' timestep='0.01'"))).kp, K / (0.02 * 0.02), 1e-2);
  const string unsafe = world("<geom type='plane' size='0 0 1'/>" + of_2_kg(fast),
                              "<option cone='elliptic'><flag refsafe='disable'/></option>");
  EXPECT_NEAR(spring_of(read(unsafe)).kp, K / (0.001 * 0.001), 1e-2 * K);
}

TEST(MjcfContactSoftness, and_friction_of_option_are_those_of_all_contacts_where_its_flag_says_so) {
  const Import wanted = read(on_ground(sphere + "priority='1' friction='0.3' solref='0.1 0.5' solimp='0.8 0.8 0.01'"));
  const auto with = [](const string& flag) {
    return read(world("<geom name='ground' type='plane' size='0 0 1'/>" +
                          of_2_kg(sphere + "priority='1' friction='0.9' solref='0.3 1'"),
                      "<option cone='elliptic' o_friction='0.3 0.3' o_solref='0.1 0.5' o_solimp='0.8 0.8 0.01'>"
                      "<flag override='" +
                          flag + "'/></option>"));
  };
  const Import all = with("enable"), own = with("disable");
  EXPECT_EQ(spring_of(all).kp, spring_of(wanted).kp);
  EXPECT_EQ(spring_of(all).kd, spring_of(wanted).kd);
  EXPECT_EQ(*all.model.contacts[0].friction, 0.3);
  EXPECT_NE(spring_of(own).kp, spring_of(wanted).kp);
  EXPECT_EQ(*own.model.contacts[0].friction, 0.9);
}

TEST(MjcfContactSoftness, is_mixed_by_priority_and_shares) {
  const auto kp = [](const string& one, const string& other) {
    const string constant = " solimp='0.8 0.8 0.01' ";
    return spring_of(read(on_ground(sphere + constant + one, "cone='elliptic'", constant + other))).kp;
  };
  const auto time = [](double constant) { return 0.64 / (0.64 * 0.2 * 0.5 * constant * constant); };
  const auto near = [](double value, double expected) { EXPECT_NEAR(value, expected, 1e-9 * expected); };
  near(kp("solref='0.1 1'", "solref='0.2 1'"), time(0.15));
  near(kp("solref='0.1 1' priority='2'", "solref='0.2 1' priority='1'"), time(0.1));
  near(kp("solref='0.1 1' solmix='3'", "solref='0.2 1'"), time(0.125));
  near(kp("solref='0.1 1' solmix='0'", "solref='0.2 1'"), time(0.2));
  near(kp("solref='0.1 1' solmix='0'", "solref='0.2 1' solmix='0'"), time(0.15));
  near(kp("solref='-100 -1'", "solref='-60 -3'"), 100.0 / (0.2 * 0.5));
  near(kp("solref='-100 -1'", "solref='0.1 1'"), kp("solref='-100 -1' priority='1'", ""));
}

// An edge of a pyramid of n edges: R = 2 mu^2 (1 + mu^2) A (1 - d) / (d impratio), the normal has n of them.
TEST(MjcfContactSoftness, is_less_in_a_pyramid_of_friction) {
  const auto kp = [](const string& option, const string& contact) {
    return spring_of(read(on_ground(sphere + "priority='1' solref='0.1 1' solimp='0.8 0.8 0.01' " + contact, option)))
        .kp;
  };
  const double elliptic = kp("cone='elliptic' impratio='7'", "friction='0.7'");
  const double edge = 2.0 * 0.49 * 1.49;
  EXPECT_NEAR(kp("", "friction='0.7'") / elliptic, 4.0 / edge, 1e-9);
  EXPECT_NEAR(kp("impratio='7'", "friction='0.7' condim='6'") / elliptic, 10.0 * 7.0 / edge, 1e-7);
  EXPECT_NEAR(kp("impratio='7'", "friction='0.7' condim='1'") / elliptic, 1.0, 1e-9);
}

// MuJoCo's contact acts from the margin on, lockstep's from the surface.
TEST(MjcfContactSoftness, overlaps_less_by_the_margin) {
  const string geom = sphere + "priority='1' solref='0.1 0.5' solimp='0.8 0.8 0.01' ";
  const double load = 2.0 * 9.81, sunk = load / spring_of(read(on_ground(geom))).kp;
  const auto kp = [&](const string& margin, const string& ground) {
    return spring_of(read(on_ground(geom + margin, "cone='elliptic'", ground))).kp;
  };
  ASSERT_GT(sunk, 0.001);
  EXPECT_NEAR(load / kp("margin='0.0003'", "margin='0.0002'"), sunk - 0.0005, 1e-12);
  const Import stands_off = read(on_ground(geom + "margin='0.01'"));
  EXPECT_FALSE(stands_off.model.contacts.at(0).softness);
}

// Numbers of both kinds in one solref are MuJoCo's own.
TEST(MjcfContactSoftness, has_times_or_direct_numbers) {
  const auto kp = [](const string& solref) {
    return spring_of(read(on_ground(sphere + "priority='1' solimp='0.8 0.8 0.01' solref='" + solref + "'"))).kp;
  };
  for (const char* solref : {"0 1", "-100 1", "0.1 -1"}) EXPECT_EQ(kp(solref), kp("0.02 1")) << solref;
}

TEST(MjcfContactSoftness, of_mujocos_own_numbers_is_that_of_lockstep) {
  const Import import = read(on_ground(sphere + "solref='0.02 1' solimp='0.9 0.95' condim='3'"));
  EXPECT_FALSE(import.model.contacts.at(0).softness);
  EXPECT_TRUE(std::holds_alternative<Hard>(import.model.colliders.at(1).softness));
}

// A ground that a caller adds.
TEST(MjcfContactSoftness, of_a_geom_is_that_of_its_contact_with_the_world) {
  const string soft = sphere + "priority='1' solimp='0.1 0.9 0.02'";
  const Import alone = read(world(of_2_kg(soft), "<option cone='elliptic'/>"));
  const Spring spring = std::get<Spring>(alone.model.colliders.at(0).softness);
  EXPECT_EQ(spring.kp, spring_of(read(on_ground(soft))).kp);
  expect_reports(alone, "geoms whose contacts are soft (1): b by 2.13e+03 N/m and 174 N s/m");
}

TEST(MjcfContactSoftness, of_a_pair_is_its_own) {
  const string text = world("<geom name='ground' type='plane' size='0 0 1'/>" + of_2_kg(sphere + "solref='0.5 1'"),
                            "<option cone='elliptic'/><contact><pair geom1='ground' geom2='b' solref='0.1 1' "
                            "solimp='0.8 0.8 0.01'/></contact>");
  EXPECT_NEAR(spring_of(read(text)).kp, 0.64 / (0.64 * 0.1 * 0.1 * 0.2 * 0.5), 1e-6);
  const string own = world("<geom name='ground' type='plane' size='0 0 1'/>" + of_2_kg(sphere + "solref='0.5 1'"),
                           "<contact><pair geom1='ground' geom2='b'/></contact>");
  EXPECT_TRUE(is_hard(read(own).model.contacts.at(0).softness.value()));
}

// Four feet, the front ones nearer to the centre of mass. Equal springs would bear 3/4 and 1/4 of the weight in front
// and behind.
TEST(MjcfContactSoftness, is_chosen_at_the_load_that_a_foot_bears) {
  const auto foot = [](const string& place) {
    return "<geom type='sphere' size='0.05' mass='0' priority='1' solimp='0.015 1 0.031' pos='" + place + "'/>";
  };
  const string text =
      world("<body name='b' pos='0 0 0.25'><freejoint/><inertial mass='8' pos='0.1 0 0' diaginertia='1 1 1'/>" +
                foot("0.2 0.1 -0.2") + foot("0.2 -0.1 -0.2") + foot("-0.2 0.1 -0.2") + foot("-0.2 -0.1 -0.2") +
                "<geom type='box' size='0.3 0.1 0.1' mass='0'/></body>",
            "<option cone='elliptic'/>");
  const Model model = read(text).model;
  const auto sunk = [&](int foot, double load) {
    return load / std::get<Spring>(model.colliders.at(static_cast<std::size_t>(foot)).softness).kp;
  };
  const auto depth = [](double load) {  // bisection of MuJoCo's law at A = 1/8 kg
    double low = 0.0, high = 0.031;
    for (int i = 0; i < 60; ++i) {
      const double r = 0.5 * (low + high), x = r / 0.031, y = x < 0.5 ? 2.0 * x * x : 1.0 - 2.0 * (1.0 - x) * (1.0 - x);
      const double d = 0.015 + y * (0.9999 - 0.015), K = 1.0 / std::pow(0.9999 * 0.02, 2);
      (K * d * d * r / ((1.0 - d) * 0.125) < load ? low : high) = r;
    }
    return low;
  };
  const double weight = 8.0 * 9.81, front = 0.375 * weight, back = 0.125 * weight;
  EXPECT_NEAR(sunk(0, front), depth(front), 1e-9);
  EXPECT_NEAR(sunk(3, back), depth(back), 1e-9);
}

// Heights at rest by MuJoCo 3.14 (WebAssembly), 16 s after the start, of a box of 0.2 x 0.4 x 0.2 m, a sphere of 0.1 m,
// a capsule of 0.1 m and 0.4 m on its side, and a body on two spheres: 2 kg each.
struct Resting {
  const char *name, *geom, *option;
  double height;
};
void PrintTo(const Resting& resting, std::ostream* stream) { *stream << resting.name; }

class MjcfRest : public testing::TestWithParam<Resting> {};

TEST_P(MjcfRest, is_at_the_height_that_mujoco_finds) {
  const auto& [name, geom, option, height] = GetParam();
  const Model model = read(on_ground(geom, option, "friction='0.6'")).model;
  Batch<double> batch(compile(model, {.dt = 1.0 / 480.0}), 1);
  batch.step(4 * 480);
  EXPECT_NEAR(batch.root_poses()(2, 0), height, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(
    mujoco, MjcfRest,
    testing::Values(Resting{"box", "type='box' size='0.1 0.2 0.1' priority='1' solimp='.015 1 .031'", "cone='elliptic'",
                            0.0891035670},
                    Resting{"sphere", "type='sphere' size='0.1' solref='.05 1' solimp='.3 .9 .01'", "cone='elliptic'",
                            0.0968757300},
                    Resting{"capsule", "type='capsule' size='0.1 0.2' euler='90 0 0' solref='-2000 -100'",
                            "cone='elliptic'", 0.0997477160},
                    Resting{"box_pyramid",
                            "type='box' size='0.1 0.2 0.1' priority='1' solimp='.015 1 .031' condim='4' friction='.6'",
                            "impratio='4'", 0.0943413823},
                    Resting{"sphere_pyramid",
                            "type='sphere' size='0.1' solref='.05 1' solimp='.3 .9 .01' condim='4' friction='.6'",
                            "impratio='4'", 0.0995457744}),
    [](const auto& given) { return string(given.param.name); });

}  // namespace
}  // namespace lockstep
