// Random mechanisms and random starts: what is written, and what is refused before anything is.
// SPDX-License-Identifier: Apache-2.0
#include <functional>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

// chain8 with a limit of each kind on its first joint, half a range on the second, and a payload that is fixed to l3.
Model limited() {
  Model model = scenes::chain8();
  model.joints[0].lower = -1.0, model.joints[0].upper = 1.5;
  model.joints[0].velocity_limit = 4.0, model.joints[0].effort_limit = 2.0;
  model.joints[1].upper = 1.0;
  model.joints[0].damping = 0.5;
  model.links.push_back({"payload", Inertia::box(0.3, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())});
  Joint weld;
  weld.name = "weld", weld.parent = "l3", weld.child = "payload";
  model.joints.push_back(weld);
  return model;
}

ParameterSet all_fields() {
  ParameterSet set;
  for (int p = 0; p < parameter_count; ++p) set.insert(static_cast<Parameter>(p));
  return set;
}

const Plan& plan() {
  static const Plan it = compile(limited(), {.per_environment = all_fields()});
  return it;
}

template <class S>
using Array = typename Batch<S>::Array;

TEST(Randomize, scales_adds_to_and_replaces_the_compiled_values_so_calls_do_not_add_up) {
  Batch<float> batch(plan(), 200, {.threads = 1, .seed = 5});
  auto damping = batch.parameter(Parameter::damping);
  const float model = damping(0, 0);
  ASSERT_GT(model, 0.0f);
  damping.row(0) = 99.0f;
  batch.randomize(Parameter::damping, {.low = 0.5, .high = 2.0});
  const Array<float> once = damping;
  EXPECT_GE(damping.row(0).minCoeff(), 0.5f * model);
  EXPECT_LE(damping.row(0).maxCoeff(), 2.0f * model);
  EXPECT_LT(damping.row(0).minCoeff(), 0.6f * model);
  EXPECT_GT(damping.row(0).maxCoeff(), 1.9f * model);
  batch.randomize(Parameter::damping, {.low = 0.5, .high = 2.0});
  EXPECT_TRUE((damping == once).all()) << "the same episode and stream draw the same";
  batch.randomize(Parameter::damping, {.low = 0.5, .high = 2.0, .stream = 1});
  EXPECT_FALSE((damping == once).any());

  batch.randomize(Parameter::damping, {.change = Change::add, .low = 0.1, .high = 0.2, .rows = {0}});
  EXPECT_GE(damping.row(0).minCoeff(), model + 0.1f);
  EXPECT_LE(damping.row(0).maxCoeff(), model + 0.2f);
  batch.randomize(Parameter::damping, {.change = Change::absolute, .low = 7.0, .high = 8.0, .rows = {3}});
  EXPECT_GE(damping.row(3).minCoeff(), 7.0f);
  EXPECT_LE(damping.row(3).maxCoeff(), 8.0f);
  batch.randomize(Parameter::damping, {});
  EXPECT_TRUE((damping.row(0) == model).all()) << "times 1";
}

TEST(Randomize, changes_the_chosen_rows_and_environments_alone) {
  Batch<double> batch(plan(), 6, {.threads = 1});
  auto mass = batch.parameter(Parameter::mass);
  const Array<double> before = mass;
  batch.randomize(Parameter::mass, {.low = 1.1, .high = 1.3, .rows = {5, 2}}, {1, 4});
  for (Eigen::Index row = 0; row < mass.rows(); ++row)
    for (int e = 0; e < 6; ++e)
      EXPECT_EQ(mass(row, e) != before(row, e), (row == 5 || row == 2) && (e == 1 || e == 4)) << row << " " << e;
  // A row has the same draw whatever else is drawn.
  const double of_two = mass(2, 4);
  batch.randomize(Parameter::mass, {.low = 1.1, .high = 1.3}, {4});
  EXPECT_EQ(mass(2, 4), of_two);
  batch.randomize(Parameter::mass, {}, {});
  EXPECT_EQ(mass(2, 4), of_two) << "nobody";
}

TEST(Randomize, shares_one_draw_if_asked) {
  Batch<double> batch(plan(), 4, {.threads = 1});
  auto mass = batch.parameter(Parameter::mass);
  const Array<double> before = mass;
  batch.randomize(Parameter::mass, {.low = 0.5, .high = 1.5, .shared = true});
  for (int e = 0; e < 4; ++e)
    for (Eigen::Index row = 1; row < mass.rows(); ++row)
      EXPECT_NEAR(mass(row, e) / before(row, e), mass(1, e) / before(1, e), 1e-14);
  batch.randomize(Parameter::mass, {.low = 0.5, .high = 1.5});
  EXPECT_NE(mass(1, 0) / before(1, 0), mass(2, 0) / before(2, 0));
}

TEST(Randomize, leaves_limits_that_are_not_there) {
  Batch<float> batch(plan(), 5, {.threads = 1});
  auto limits = batch.parameter(Parameter::position_limits);
  const Array<float> before = limits;
  batch.randomize(Parameter::position_limits, {.change = Change::add, .low = -0.2, .high = 0.2});
  for (Eigen::Index row = 0; row < limits.rows(); ++row)
    for (int e = 0; e < 5; ++e) EXPECT_EQ(limits(row, e) != before(row, e), std::isfinite(before(row, e)));
  batch.randomize(Parameter::velocity_limit, {.low = 0.5, .high = 0.9});
  batch.randomize(Parameter::effort_limit, {.low = 0.5, .high = 0.9});
  batch.step();
  EXPECT_EQ(batch.faulted(), 0) << batch.explain_fault(0);
}

TEST(Randomize, draws_the_distributions_that_it_names) {
  constexpr int many = 20000;
  Batch<double> batch(plan(), many, {.threads = 1, .seed = 3});
  auto gravity = batch.parameter(Parameter::gravity);
  batch.randomize(Parameter::gravity,
                  {.change = Change::absolute, .low = -9.0, .high = 2.0, .distribution = Distribution::normal});
  const auto z = gravity.row(2);
  EXPECT_NEAR(z.mean(), -9.0, 4.0 * 2.0 / std::sqrt(many));
  EXPECT_NEAR((z + 9.0).square().mean(), 4.0, 4.0 * 4.0 * std::sqrt(2.0 / many));
  batch.randomize(Parameter::gravity,
                  {.change = Change::absolute, .low = 0.01, .high = 100.0, .distribution = Distribution::log_uniform});
  EXPECT_GE(z.minCoeff(), 0.01 * (1.0 - 1e-12));
  EXPECT_LE(z.maxCoeff(), 100.0);
  const double share = (z < 1.0).cast<double>().mean();  // 1 is the middle
  EXPECT_NEAR(share, 0.5, 4.0 * 0.5 / std::sqrt(many));
  EXPECT_NEAR((z.log() / std::log(10.0)).square().mean(), 4.0 / 3.0, 4.0 * 1.2 / std::sqrt(many));
}

// The same bits for any place, size, threads and precision.
TEST(Randomize, depends_on_the_id_alone) {
  Batch<float> all(plan(), 30, {.threads = 1, .seed = 8}), some(plan(), 4, {.threads = 2, .seed = 8, .first_id = 20});
  for (Batch<float>* batch : {&all, &some}) {
    batch->randomize(Parameter::gear_ratio, {.low = 0.9, .high = 1.1});
    batch->randomize(Parameter::offset,
                     {.change = Change::add, .low = 0.0, .high = 0.01, .distribution = Distribution::normal});
    batch->reset_random(EnvironmentSet::all(), {.spread = 0.5, .speed = 0.3});
    batch->step(20);
  }
  for (int e = 0; e < 4; ++e) EXPECT_TRUE(contract::same_bits(all, 20 + e, some, e));
}

// ---------------------------------------------------------------- refusals

struct Refused {
  const char* name;
  Parameter field;
  Randomization how;
  const char* words;
};

class RefusedRandomization : public testing::TestWithParam<Refused> {};

TEST_P(RefusedRandomization, writes_nothing_and_names_element_bound_and_remedy) {
  const auto refuse = [&]<class S>(Batch<S> batch) {
    const Array<S> before = batch.parameter(GetParam().field);
    try {
      batch.randomize(GetParam().field, GetParam().how);
      FAIL() << "accepted";
    } catch (const UsageError& error) {
      EXPECT_NE(std::string(error.what()).find(GetParam().words), std::string::npos) << error.what();
      EXPECT_FALSE(error.remedy().empty());
    }
    EXPECT_TRUE((before == batch.parameter(GetParam().field)).all());
  };
  refuse(Batch<float>(plan(), 50, {.threads = 1}));
  refuse(Batch<double>(plan(), 50, {.threads = 1}));
}

constexpr double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    values, RefusedRandomization,
    testing::Values(
        Refused{"mass_zero", Parameter::mass, {.low = 0.0, .high = 1.0}, "may become 0, must be above 0"},
        Refused{
            "mass_negative", Parameter::mass, {.change = Change::add, .low = -50.0, .rows = {2}}, "must be above 0"},
        Refused{"sum_of_masses", Parameter::mass, {.low = 0.0, .high = 0.0, .rows = {4, 9}}, "masses of link"},
        Refused{"kp_negative", Parameter::drive_gains, {.change = Change::add, .low = -100.0}, "kp of joint 'j0'"},
        Refused{"ratio_through_zero", Parameter::gear_ratio, {.low = -1.0}, "1e-9 to 1e9 in magnitude"},
        Refused{"ratio_large", Parameter::gear_ratio, {.high = 1e10}, "1e-9 to 1e9 in magnitude"},
        Refused{"erp", Parameter::softness, {.change = Change::absolute, .high = 2.5, .rows = {0}}, "0 to below 2"},
        Refused{"damping_normal",
                Parameter::damping,
                {.change = Change::absolute, .low = 0.1, .high = 1.0, .distribution = Distribution::normal},
                "in environment"},
        Refused{"limits_cross",
                Parameter::position_limits,
                {.change = Change::add, .low = -9.0, .high = 9.0},
                "limits of joint 'j0'"},
        Refused{"limit_that_is_not_there",
                Parameter::velocity_limit,
                {.change = Change::absolute, .low = 1.0, .high = 2.0, .rows = {3}},
                "as the model gives it no limit"},
        Refused{"inertia", Parameter::inertia, {.low = 0.2, .high = 5.0}, "moments of inertia of link"},
        Refused{"inertia_negative", Parameter::inertia, {.low = -1.0, .high = -1.0}, "moments of inertia of link"},
        Refused{"gravity",
                Parameter::gravity,
                {.change = Change::absolute, .low = 1e308, .high = 1e308, .distribution = Distribution::normal},
                "must be finite"},
        Refused{"order", Parameter::mass, {.low = 1.2, .high = 1.1}, "low <= high"},
        Refused{"nan", Parameter::mass, {.low = nan, .high = 1.1}, "finite"},
        Refused{"infinite", Parameter::mass, {.low = 1.0, .high = inf}, "finite"},
        Refused{"logarithm",
                Parameter::mass,
                {.low = 0.0, .high = 1.0, .distribution = Distribution::log_uniform},
                "logarithm"},
        Refused{"deviation",
                Parameter::mass,
                {.low = 1.0, .high = -0.1, .distribution = Distribution::normal},
                "standard deviation"},
        Refused{"row", Parameter::gravity, {.rows = {3}}, "give 0 to 2"},
        Refused{"negative_row", Parameter::gravity, {.rows = {-1}}, "give 0 to 2"},
        Refused{"stream", Parameter::gravity, {.stream = stream_count}, "stream 32768"},
        Refused{"change", Parameter::gravity, {.change = Change(7)}, "none of the enumerators"},
        Refused{"distribution", Parameter::gravity, {.distribution = Distribution(-1)}, "none of the enumerators"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(Randomize, refuses_fields_that_were_not_declared_and_environments_that_do_not_fit) {
  Batch<float> batch(compile(scenes::chain8(), {.per_environment = {Parameter::mass}}), 3, {.threads = 1});
  EXPECT_THROW(batch.randomize(Parameter::damping, {}), UsageError);
  EXPECT_THROW(batch.randomize(Parameter(99), {}), UsageError);
  EXPECT_THROW(batch.randomize(Parameter::mass, {}, {3}), UsageError);
}

// ---------------------------------------------------------------- random starts

// A finger of two links whose second follows the first, by a hard or a soft coupling, and a joint without a range.
Model finger(const Softness& softness) {
  Model model = scenes::chain8();
  model.couplings = {Coupling::mimic("j1", "j0", -0.5, 0.1, softness),
                     {"j4", {{"j2", 0.3}, {"j3", -0.7}}, -0.05, softness}};
  for (int j : {0, 2, 3}) model.joints[j].lower = -0.4, model.joints[j].upper = 0.8 + 0.1 * j;
  model.joints[5].position = 0.25;
  model.joints[6].position = 0.125, model.joints[6].upper = 1.0;
  return model;
}

TEST(RandomReset, spreads_independent_joints_over_their_ranges_and_places_followers) {
  for (const Softness& softness : {Softness(Hard{}), Softness(Frequency{30.0, 1.0})}) {
    const Plan plan = compile(finger(softness), {.per_environment = {Parameter::gear_ratio, Parameter::offset}});
    constexpr int many = 2000;
    Batch<double> batch(plan, many, {.threads = 1, .seed = 4});
    batch.randomize(Parameter::gear_ratio, {.low = 0.9, .high = 1.1});
    batch.randomize(Parameter::offset, {.change = Change::add, .low = -0.05, .high = 0.05});
    EXPECT_TRUE(batch.reset_random(EnvironmentSet::all(), {.spread = 0.5, .speed = 2.0}).empty());
    EXPECT_EQ(batch.resets()[7], 1u);
    EXPECT_LE(batch.coupling_errors().abs().maxCoeff(), 1e-6);
    constexpr double start = 0.3;  // of chain8's joints
    for (int j : {0, 2, 3}) {
      const double lower = -0.4, upper = 0.8 + 0.1 * j, reach = 0.25 * (upper - lower);
      const double middle = 0.5 * start + 0.25 * (lower + upper);  // half of the way to each end
      const auto q = batch.positions().row(j);
      EXPECT_GE(q.minCoeff(), middle - reach);
      EXPECT_LE(q.maxCoeff(), middle + reach);
      EXPECT_LT(q.minCoeff(), middle - 0.99 * reach);
      EXPECT_GT(q.maxCoeff(), middle + 0.99 * reach);
      EXPECT_NEAR(q.mean(), middle, 4.0 * reach / std::sqrt(3.0 * many));
      EXPECT_LE(batch.velocities().row(j).abs().maxCoeff(), 2.0);
      EXPECT_NEAR(batch.velocities().row(j).square().mean(), 4.0 / 3.0, 0.15);
    }
    EXPECT_TRUE((batch.positions().row(5) == 0.25).all()) << "no range";
    EXPECT_TRUE((batch.positions().row(6) == 0.125).all()) << "half a range";
    // A following reset draws anew, of its environments alone.
    const Array<double> before = batch.positions();
    batch.reset_random({3}, {.spread = 0.5, .speed = 2.0});
    EXPECT_NE(batch.positions()(0, 3), before(0, 3));
    EXPECT_EQ(batch.positions()(0, 4), before(0, 4));
    // The start, at rest.
    batch.reset_random(EnvironmentSet::all(), {.spread = 0.0});
    EXPECT_TRUE((batch.positions().row(0) == start).all());
    EXPECT_TRUE((batch.velocities() == 0.0).all());
  }
}

TEST(RandomReset, uses_the_limits_of_the_environment_and_keeps_inputs_if_asked) {
  Model model = limited();
  model.joints[2].lower = -1.0, model.joints[2].upper = 1.5;
  const Plan plan = compile(model, {.per_environment = {Parameter::position_limits}});
  Batch<float> batch(plan, 50, {.threads = 1});
  batch.parameter(Parameter::position_limits).row(4) = 1.25f;
  batch.position_targets().setConstant(0.5f);
  batch.reset_random(EnvironmentSet::all(), {.keep_inputs = true});
  EXPECT_GE(batch.positions().row(2).minCoeff(), 1.25f);
  EXPECT_LE(batch.positions().row(2).maxCoeff(), 1.5f);
  EXPECT_EQ(batch.position_targets()(3, 7), 0.5f);
  batch.reset_random();
  EXPECT_EQ(batch.position_targets()(3, 7), 0.0f);
}

TEST(RandomReset, refuses_what_is_out_of_range_and_changes_nothing) {
  Batch<float> batch(plan(), 3, {.threads = 1});
  batch.step();
  const auto refused = [&](const RandomReset& how) {
    EXPECT_THROW(batch.reset_random(EnvironmentSet::all(), how), UsageError);
  };
  refused({.spread = 1.1});
  refused({.spread = -0.1});
  refused({.spread = nan});
  refused({.speed = -1.0});
  refused({.speed = inf});
  refused({.speed = 1e39});
  refused({.stream = stream_count});
  refused({.project = Couplings(9)});
  EXPECT_THROW(batch.reset_random({3}), UsageError);
  EXPECT_EQ(batch.steps()[0], 1u);
}

}  // namespace
}  // namespace lockstep
