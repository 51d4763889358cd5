// Models of every kind of row, built from the input, compiled and stepped: refused or sound, no neighbour changed, and
// as the reference has it where that has such models. SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "fuzz.h"
#include "physics.h"
#include "plan/program.h"
#include "reference/step.h"
#include "scenes/any_model.h"

using namespace lockstep;

namespace {

constexpr int environments = 5, spoiled = 2;

// The others than the spoiled one have the bits of a batch in which nothing is spoiled.
template <class S>
void require_isolation(const Plan& plan, Engine engine) {
  const BatchOptions options{.threads = 1, .engine = engine};
  Batch<S> clean(plan, environments, options), dirty(plan, environments, options);
  clean.step(4);
  dirty.positions().col(spoiled).setConstant(std::numeric_limits<S>::quiet_NaN());
  dirty.velocities().col(spoiled).setConstant(S(1e30));
  dirty.step(4);
  fuzz::require_sound(clean), fuzz::require_sound(dirty);
  for (int e = 0; e < environments; ++e) {
    if (e == spoiled) continue;
    for (int dof = 0; dof < plan.dofs(); ++dof) {
      const S a = clean.velocities()(dof, e), b = dirty.velocities()(dof, e);
      fuzz::require(std::memcmp(&a, &b, sizeof a) == 0, "a spoiled environment changes its neighbours");
    }
  }
}

// One step of Euler's against the reference, which throws std::logic_error for what it does not have.
void compare(const Model& model, StepSettings settings, const Plan& plan) {
  if (plan.integrator() != Integrator::euler || !model.contacts.empty() || settings.stage_inputs) return;
  if (program_of(plan).f64.bounds.may_depend) return;  // rows that contradict each other share what is left
  for (const Joint& joint : model.joints)
    if (joint.kind == JointKind::tendon || joint.kind == JointKind::ball || joint.drive.delay > 0 ||
        joint.drive.lag > 0.0 || joint.drive.stall_effort < infinity)
      return;
  settings.method = plan.method(), settings.integrator = Integrator::euler;
  Batch<double> batch(plan, 1, {.threads = 1, .engine = Engine::tables});
  const reference::Mechanism mechanism(model);
  batch.step(1);
  if (batch.faulted() > 0) return;
  const reference::State ours = physics::state_of(batch);
  try {
    const reference::Step theirs =
        reference::step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
    const Eigen::VectorXd sizes = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(theirs.stage.implicit).eigenvalues();
    if (sizes.size() > 0 && !(sizes[0] > 1e-8 * sizes[sizes.size() - 1])) return;  // rounding grows too much
    const double scale = 1.0 + theirs.state.v.lpNorm<Eigen::Infinity>();
    fuzz::require(physics::distance(ours.v, theirs.state.v) <= 1e-5 * scale, "the step is not the reference's");
  } catch (const std::logic_error&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  scenes::AnyModel any({data, size});
  const Model model = any.model();
  const StepSettings settings = any.settings();
  fuzz::taken([&] {
    const Plan plan = compile(model, settings);
    if (plan.dofs() == 0) return;  // nothing to spoil
    // Machine code takes longer to make than all else here, so one in eight has it.
    const Engine engine = size % 8 == 0 ? Engine::automatic : Engine::tables;
    require_isolation<float>(plan, engine);
    require_isolation<double>(plan, engine);
    compare(model, settings, plan);
  });
  return 0;
}
