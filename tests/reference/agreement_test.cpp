// The kernels agree with the scalar reference, stage by stage and method by method. SPDX-License-Identifier: Apache-2.0
//
// The tests use random trees, fixed and floating, of 1 to 24 dofs with couplings of 2 to 5 joints and every softness.
// Kernels and reference share no arithmetic, so a difference beyond rounding is a mistake in one of them.
//
// Tolerances for rounding: 1e-12 of the scale of a quantity for sums and products. A solve with a symmetric positive
// definite H amplifies rounding by at most n times the condition number of H with its diagonal scaled to 1, up to a
// small factor (Demmel 1989; Higham 2002, section 10.1). So results of solves are allowed this, and at least 1e-11.
#include "kernels/step.h"

#include <algorithm>
#include <vector>

#include "lockstep/plan.h"
#include "physics.h"
#include "plan/layout.h"
#include "plan/program.h"
#include "reference/step.h"
#include "scenes/scenes.h"
#include "seeds.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using physics::condition;
using physics::distance;
using physics::size;
using Scalar = simd::Wide<double, 1, simd::Unfused>;

const int seeds = seeds_of(1000, 250), forest_seeds = seeds_of(300, 80);
constexpr double close = 1e-12, solved_close = 1e-11;

double solved(double condition, int n) { return std::max(solved_close, n * physics::epsilon * condition); }

template <class A, class B>
void expect_close(const char* what, const A& ours, const B& theirs, double scale, double tolerance = close) {
  EXPECT_LE(distance(ours, theirs), tolerance * scale) << what;
}

// How A_r is formed, or how a step does without it.
enum class Formulation { as_planned, by_entries, composite_columns, articulated };
constexpr const char* names[] = {"as planned", "by entries", "composite columns", "articulated"};

// Runs the stages of the kernels on one environment without a Batch.
struct Kernel {
  Kernel(const Plan& compiled, const reference::State& state, const reference::Inputs& inputs,
         Formulation formulation = Formulation::as_planned)
      : plan(compiled),
        program(formulated(program_of(plan), formulation)),
        t(program.f64),
        q(state.q),
        v(state.v.tail(t.joints)),
        root_velocities(state.v.head(6 * t.roots.count)),
        position_targets(inputs.position_targets),
        velocity_targets(inputs.velocity_targets),
        efforts(inputs.efforts) {
    root_poses.resize(7 * t.roots.count);
    int floating = 0;
    for (std::size_t tree = 0; tree < state.roots.size(); ++tree) {
      if (!plan.model().roots[tree].floating) continue;
      const Eigen::Quaterniond& turn = state.roots[tree].orientation;
      root_poses.segment<7>(7 * floating++) << state.roots[tree].position, turn.w(), turn.x(), turn.y(), turn.z();
    }
    batch.stride = 1;
    batch.position = q.data(), batch.velocity = v.data();
    batch.root_pose = root_poses.data(), batch.root_velocity = root_velocities.data();
    batch.position_target = position_targets.data(), batch.velocity_target = velocity_targets.data();
    batch.effort = efforts.data(), batch.audit = audit.data(), batch.fault = &fault;
    scratch.resize(kernels::lay_out(t, nullptr, x) / sizeof(std::max_align_t) + 1);
    kernels::lay_out(t, scratch.data(), x);
    kernels::uniform_masses(t, x);
    kernels::uniform_ratios(t, x);
    kernels::load(t, batch, x);
  }

  static Program formulated(Program program, Formulation formulation) {
    Tables<double>& t = program.f64;
    if (formulation == Formulation::as_planned) return program;
    const std::vector<bool> all(static_cast<std::size_t>(t.tree.count), true);
    program.folded.clear();
    t.reduction = {}, t.articulated = {};
    t.solver = t.matrix;
    set_inertia(program, all, InertiaKind::matrix);
    if (program.method == Method::reduced && formulation != Formulation::articulated) eliminate_followers(program);
    lay_out_rows(program);
    if (formulation == Formulation::composite_columns) use_composite_columns(program, all);
    std::vector<bool> with_joints;  // articulated bodies are for trees with joints
    for (int tree = 0; tree < t.tree.count; ++tree)
      with_joints.push_back(t.tree[tree].first_joint < t.tree[tree].last_joint);
    if (formulation == Formulation::articulated) set_inertia(program, with_joints, InertiaKind::articulated_bodies);
    lay_out_factoring(program);
    return program;
  }

  // The index in the model of a generalised velocity of the kernels.
  int outer(int i) const {
    for (int r = 0; r < t.roots.count; ++r)
      if (i >= t.roots[r].velocity && i < t.roots[r].velocity + 6) return 6 * r + i - t.roots[r].velocity;
    int joint = 0;
    while (t.velocity_of(joint) != i) ++joint;
    return 6 * t.roots.count + t.dof[joint];
  }
  VectorXd velocities(const Scalar* values) const {
    VectorXd result(t.velocities);
    for (int i = 0; i < t.velocities; ++i) result[outer(i)] = values[i].lane(0);
    return result;
  }
  VectorXd numbers(const Scalar* values, int count) const {
    VectorXd result(count);
    for (int i = 0; i < count; ++i) result[i] = values[i].lane(0);
    return result;
  }
  MatrixXd unpacked(const Columns& columns, const Scalar* packed) const {
    MatrixXd result = MatrixXd::Zero(columns.n, columns.n);
    for (int i = 0; i < columns.n; ++i)
      for (int j = 0; j < columns.n; ++j)
        if (const int entry = entry_of(columns, i, j); entry >= 0) result(i, j) = packed[entry].lane(0);
    return result;
  }
  MatrixXd joint_matrix() const {
    const MatrixXd inner = unpacked(t.matrix, x.dynamics.matrix);
    MatrixXd result(t.velocities, t.velocities);
    for (int i = 0; i < t.velocities; ++i)
      for (int j = 0; j < t.velocities; ++j) result(outer(i), outer(j)) = inner(i, j);
    return result;
  }
  MatrixXd delassus() const {  // K
    const Rows<double>& rows = t.rows;
    if (rows.columns.n > 0) return unpacked(rows.columns, x.rows.delassus);
    MatrixXd result(rows.count, rows.count);
    for (int r = 0; r < rows.count; ++r)
      for (int s = 0; s < rows.count; ++s) result(r, s) = x.rows.delassus[r * rows.count + s].lane(0);
    return result;
  }

  Plan plan;
  const Program program;
  const Tables<double>& t;
  VectorXd q, v, root_poses, root_velocities, position_targets, velocity_targets, efforts, audit = VectorXd::Zero(2);
  Fault fault = Fault::none;
  StatePointers<double> batch;
  kernels::Tile<Scalar> x;
  std::vector<std::max_align_t> scratch;
};

StepSettings settings_of(Method method, int seed) {
  constexpr int iterations[] = {1, 2, 4, 16}, velocity_iterations[] = {0, 1, 3};
  StepSettings settings;
  settings.method = method;
  settings.integrator = Integrator::euler;
  settings.iterations = iterations[seed % 4];
  settings.velocity_iterations = velocity_iterations[seed / 4 % 3];
  settings.record_impulses = seed % 3 > 0;  // without them, the plan may form A_r in another way
  return settings;
}

// All velocities from the solver's velocities, by J alone: v = S z + w. If followers are eliminated, J S = 0 and
// J w = -erp C / h. If constraint velocities replace them, z = J v there.
struct Basis {
  Basis(const Kernel& kernel, const reference::Stage& stage, const std::vector<int>& eliminated) {
    const Reduction<double>& reduction = kernel.t.reduction;
    const int nv = kernel.t.velocities, root = nv - kernel.t.joints, n = kernel.t.solver.n;
    const bool permutes = eliminated.empty();
    std::vector<int> hard, followers, independents;
    for (int c = 0; c < stage.couplings.count(); ++c)
      if (stage.rows[c].active && stage.rows[c].hard) hard.push_back(c);
    for (int dof : eliminated) followers.push_back(root + dof);
    for (int z = 0; z < n; ++z) independents.push_back(kernel.outer(reduction.velocity_of(z)));
    s = MatrixXd::Zero(nv, n);
    w = VectorXd::Zero(nv);
    if (reduction.has_constraint_velocities()) {
      MatrixXd inverse = MatrixXd::Zero(n, nv);  // of S
      for (int z = 0; z < n; ++z) inverse(z, kernel.outer(reduction.independent[z])) = 1.0;
      for (int f = 0; f < reduction.followers; ++f)
        inverse.row(reduction.constraint_velocity[f]) =
            stage.jacobian(std::vector<int>{reduction.measured_coupling[f]}, Eigen::all);
      const Eigen::FullPivLU<MatrixXd> lu(inverse);
      s = lu.inverse();
      condition = inverse.norm() * s.norm();
      return;
    }
    for (int z = 0; z < n; ++z) s(independents[z], z) = 1.0;
    if (permutes) return;
    const MatrixXd j = stage.jacobian(hard, Eigen::all), of_followers = j(Eigen::all, followers);
    const Eigen::FullPivLU<MatrixXd> lu(of_followers);
    s(followers, Eigen::all) = -lu.solve(j(Eigen::all, independents));
    w(followers) = -lu.solve(stage.correction(hard));
    condition = of_followers.norm() * lu.inverse().norm();
  }
  MatrixXd s;
  VectorXd w;
  double condition = 1.0;  // of the matrix that gives S
};

// Compares the equations of motion of one random mechanism.
void expect_same_equations(int seed, const scenes::RandomOptions& options) {
  SCOPED_TRACE(seed);
  const Model model = scenes::random_model(seed, options);
  const reference::Mechanism mechanism(model);
  const reference::State state = mechanism.initial_state();
  const reference::Inputs inputs = mechanism.initial_inputs();
  const StepSettings settings = settings_of(Method::direct, seed);
  const reference::Stage stage(mechanism, settings.dt, state, inputs);
  Kernel kernel(compile(model, settings), state, inputs, Formulation::by_entries);

  kernels::kinematics(kernel.t, kernel.x);
  kernels::bias_forces(kernel.t, kernel.batch, kernel.x);
  for (int tree = 0; tree < kernel.t.tree.count; ++tree) kernels::mass_matrix(kernel.t, kernel.t.tree[tree], kernel.x);
  expect_close("M", kernel.joint_matrix(), stage.mass, size(stage.mass));
  expect_close("c", kernel.velocities(kernel.x.dynamics.rhs), stage.bias, size(stage.bias));

  kernels::joint_inertias(kernel.t, kernel.batch, kernel.x);
  kernels::joint_forces(kernel.t, kernel.batch, kernel.x);
  kernels::inertia_matrix(kernel.t, kernel.batch, kernel.x);
  reference::State ahead = state;
  ahead.q += settings.dt * state.v.tail(mechanism.dofs());
  const VectorXd forces = mechanism.joint_forces(ahead, inputs) - stage.bias;
  expect_close("A", kernel.joint_matrix(), stage.implicit, size(stage.implicit));
  expect_close("forces", kernel.velocities(kernel.x.dynamics.rhs), settings.dt * forces, settings.dt * size(forces));
}

TEST(EquationsOfMotion, agree_with_the_reference) {
  for (int seed = 0; seed < seeds && !HasFailure(); ++seed) expect_same_equations(seed, {});
}

TEST(EquationsOfMotion, agree_with_the_reference_on_forests) {
  for (int seed = 0; seed < forest_seeds && !HasFailure(); ++seed) expect_same_equations(seed, scenes::forests());
}

// The rounding of the frame of one link must not grow with the number of links behind it.
TEST(EquationsOfMotion, agree_with_the_reference_on_trees_of_a_hundred_joints) {
  scenes::RandomOptions deep;
  deep.min_dofs = 80, deep.max_dofs = 120;
  for (int seed = 0; seed < 10 && !HasFailure(); ++seed) expect_same_equations(seed, deep);
}

// Compares all stages before the solve of rows.
void expect_same_rows(const Model& model, const StepSettings& settings, const Plan& plan, Formulation formulation) {
  SCOPED_TRACE(names[static_cast<int>(formulation)]);
  const reference::Mechanism mechanism(model);
  const reference::State state = mechanism.initial_state();
  const reference::Inputs inputs = mechanism.initial_inputs();
  const reference::Stage stage(mechanism, settings.dt, state, inputs);
  Kernel kernel(plan, state, inputs, formulation);
  const Tables<double>& t = kernel.t;
  if (formulation == Formulation::composite_columns && t.reduction.composite.places == 0) return;  // no plan takes them
  kernels::Tile<Scalar>& x = kernel.x;
  kernels::kinematics(t, x);
  kernels::coupling_errors(t, x);
  if (t.reduction.eliminates()) kernels::follow(t, x);
  if (t.reduction.used() && !t.reduction.eliminates()) kernels::start_velocities(t, x);
  kernels::bias_forces(t, kernel.batch, x);
  kernels::joint_inertias(t, kernel.batch, x);
  kernels::joint_forces(t, kernel.batch, x);
  kernels::inertia_matrix(t, kernel.batch, x);
  if (t.reduction.by_entries()) kernels::reduce_matrix(t, x);

  // Without followers, S is a permutation, w is zero, A_r is A, and z is v*.
  const Basis e(kernel, stage, plan.eliminated_dofs());
  const MatrixXd reduced = e.s.transpose() * stage.implicit * e.s;
  if (!t.articulated.used()) expect_close("A_r", kernel.unpacked(t.solver, x.dynamics.reduced), reduced, size(reduced));
  kernels::factor_matrix(t, x);
  kernels::free_velocity(t, x);
  const Eigen::LLT<MatrixXd> factored(reduced);
  const VectorXd z = factored.solve(e.s.transpose() * stage.implicit * (stage.free - e.w));
  const std::vector<Scalar> zeros(t.rows.count, Scalar(0.0));
  for (int r = 0; r < t.rows.count * t.solver.n; ++r) x.rows.response[r] = Scalar(0.0);
  Tables<double> free = t;  // without known constraint velocities
  free.rows.known = {}, free.rows.all_known = false;
  kernels::apply_impulses(free, x, kernels::position_phase, x.dynamics.half_solved_position, Scalar(1.0), zeros.data(),
                          x.dynamics.solution);
  kernels::solve_downwards<Scalar>(free, x, x.dynamics.solution, nullptr);
  for (int i = 0; i < t.solver.n; ++i) x.dynamics.solution[i] += x.dynamics.start[i];
  const double kappa = condition(reduced) * e.condition, rounding = solved(kappa, t.solver.n);
  expect_close("v*", kernel.numbers(x.dynamics.solution, t.solver.n), z, std::max(1.0, size(z)), rounding);
  if (x.dynamics.half_solved_velocity != x.dynamics.half_solved_position) {  // the velocity phase corrects nothing
    kernels::apply_impulses(t, x, kernels::velocity_phase, x.dynamics.half_solved_velocity, Scalar(1.0), zeros.data(),
                            x.dynamics.velocity_solution);
    kernels::solve_downwards<Scalar>(t, x, x.dynamics.velocity_solution, nullptr);
    for (int i = 0; i < t.solver.n; ++i) x.dynamics.velocity_solution[i] += x.dynamics.start[i];
    const VectorXd uncorrected = factored.solve(e.s.transpose() * stage.implicit * stage.free);
    expect_close("v* of the velocity phase", kernel.numbers(x.dynamics.velocity_solution, t.solver.n), uncorrected,
                 std::max(1.0, size(uncorrected)), rounding);
  }
  if (t.rows.count == 0) return;

  if (t.undamped.count > 0) kernels::undamped_responses(t, x);
  kernels::responses(t, x);
  kernels::row_softness(t, kernel.batch, x);
  kernels::row_terms(t, x);
  std::vector<int> couplings(t.rows.coupling.data, t.rows.coupling.data + t.rows.count);
  const MatrixXd j = stage.jacobian(couplings, Eigen::all) * e.s;
  const MatrixXd k = j * factored.solve(j.transpose());
  expect_close("K", kernel.delassus(), k, size(k), rounding);
  const VectorXd speed = stage.jacobian(couplings, Eigen::all) * (e.s * z + e.w);
  expect_close("J v*", kernel.numbers(x.rows.speed, t.rows.count), speed, std::max(1.0, size(speed)), rounding);
  const VectorXd error = stage.error(couplings);
  expect_close("C", kernel.numbers(x.rows.error, t.rows.count), error, std::max(1.0, size(error)));

  const int n = settings.method == Method::tgs ? settings.iterations : 1;
  for (int r = 0; r < t.rows.count; ++r) {
    const int c = couplings[r];
    ASSERT_TRUE(stage.rows[c].active) << "the row of coupling " << c << " takes no impulse";
    const reference::Row row = reference::substep_row(stage.couplings.softness[c], stage.inertia[c], settings.dt, n);
    const double rate = row.erp / settings.dt * n;
    EXPECT_NEAR(x.rows.rate[r].lane(0), rate, close * rate);
    EXPECT_NEAR(x.rows.cfm[r].lane(0), row.cfm, rounding * row.cfm);
  }

  // If the constraint velocities of all rows are known, the other velocities follow by A_r (M79), for any known values.
  if (!t.rows.all_known) return;
  std::vector<int> known, others;
  VectorXd moved = z;
  for (int i = 0; i < t.solver.n; ++i) {
    const int r = t.rows.known[i];
    (r >= 0 ? known : others).push_back(i);
    if (r >= 0) moved[i] = 0.1 * (r + 1), x.rows.speed[r] = x.rows.velocity_phase_speed[r] = Scalar(moved[i]);
  }
  moved(others) -= reduced(others, others).llt().solve(reduced(others, known) * (moved - z)(known));
  for (int r = 0; r < t.rows.count; ++r) x.rows.position_impulse[r] = x.rows.velocity_impulse[r] = Scalar(0.0);
  kernels::solved_velocities(t, x);
  for (const Scalar* v : {x.dynamics.solution, x.solves_twice ? x.dynamics.velocity_solution : x.dynamics.solution})
    expect_close("v beside known velocities", kernel.numbers(v, t.solver.n), moved, std::max(1.0, size(moved)),
                 rounding);
}

class Agreement : public testing::TestWithParam<Method> {};

void expect_same_rows_in_all_formulations(const Model& model, const StepSettings& settings) {
  const Plan plan = compile(model, settings);
  const Tables<double>& t = program_of(plan).f64;
  expect_same_rows(model, settings, plan, Formulation::as_planned);
  expect_same_rows(model, settings, plan, Formulation::by_entries);
  if (t.reduction.eliminates() && t.undamped.count == 0)
    expect_same_rows(model, settings, plan, Formulation::composite_columns);
  if (!t.reduction.eliminates() && t.joints > 0 && t.limited_servos.count == 0)
    expect_same_rows(model, settings, plan, Formulation::articulated);
}

TEST_P(Agreement, holds_for_free_velocity_responses_and_row_terms) {
  for (int seed = 0; seed < seeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    expect_same_rows_in_all_formulations(scenes::random_model(seed), settings_of(GetParam(), seed));
  }
}

TEST_P(Agreement, holds_for_free_velocity_responses_and_row_terms_of_forests) {
  for (int seed = 0; seed < forest_seeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    expect_same_rows_in_all_formulations(scenes::random_model(seed, scenes::forests()), settings_of(GetParam(), seed));
  }
}

// Runs all mechanisms on the tables, and every fourth one by machine code as well.
void expect_same_states(int count, const scenes::RandomOptions& options, Method method) {
  for (int run = 0; run < count + count / 4; ++run) {
    const bool by_code = run >= count;
    const int seed = by_code ? 4 * (run - count) : run;
    SCOPED_TRACE(testing::Message() << seed << (by_code ? ", compiled" : ""));
    const Model model = scenes::random_model(seed, options);
    const reference::Mechanism mechanism(model);
    const StepSettings settings = settings_of(method, seed);
    const Plan plan = compile(model, settings);
    Batch<double> batch(plan, 1, {.threads = 1, .engine = by_code ? physics::engines(plan).back() : Engine::tables});
    reference::State state = mechanism.initial_state();
    double rounding = 0.0;
    for (int step = 0; step < 10; ++step) {
      const reference::Step next = reference::step(mechanism, settings, state, mechanism.initial_inputs());
      const double before = size(state.v);
      state = next.state;
      batch.step();

      // Every method solves rows with K + cfm, which amplifies the rounding of the solves with A.
      std::vector<int> active;
      for (int c = 0; c < next.stage.couplings.count(); ++c)
        if (next.stage.rows[c].active) active.push_back(c);
      MatrixXd k = next.stage.response(active, active);
      for (std::size_t r = 0; r < active.size(); ++r) k(r, r) += next.stage.rows[active[r]].cfm;
      rounding += solved(condition(next.stage.implicit) * condition(k), mechanism.velocities());
      if (step > 0 && step < 9) continue;

      const reference::State ours = physics::state_of(batch);
      const double moving = std::max({1.0, before, size(state.v)});
      expect_close("q", ours.q, state.q, std::max(1.0, size(state.q)), rounding);
      expect_close("v", ours.v, state.v, moving, rounding);
      physics::expect_same_poses(ours, state, rounding);
      if (!settings.record_impulses) continue;
      const VectorXd impulses = batch.coupling_impulses().matrix().col(0);
      const double momentum = std::max(size(next.stage.implicit) * moving, size(next.impulses));
      expect_close("impulses", impulses, next.impulses, momentum, rounding);
    }
    if (testing::Test::HasFailure()) return;
  }
}

TEST_P(Agreement, holds_for_impulses_and_states_after_one_step_and_after_ten) {
  expect_same_states(seeds, {}, GetParam());
}

TEST_P(Agreement, holds_for_impulses_and_states_of_forests_after_one_step_and_after_ten) {
  expect_same_states(forest_seeds, scenes::forests(), GetParam());
}

INSTANTIATE_TEST_SUITE_P(method, Agreement, testing::ValuesIn(physics::methods), physics::method_name);

}  // namespace
}  // namespace lockstep
