// Steps with bounds, section 12 of docs/mathematics.md. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bounds.h"
#include "step.h"

namespace lockstep::reference {

/// A step of a model that has bounds, which step() calls. Throws std::logic_error for direct and reduced where bounds
/// contradict each other or the couplings, and for pgs and tgs where no guess of which servos are at their limits
/// agrees with the velocities that follow from it.
Step bounded_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs);

/// What the methods start from. The servos in the stage act linearly or with a constant force.
struct Bounded {
  const Mechanism& mechanism;
  const StepSettings& settings;
  const Inputs& inputs;
  const Stage& stage;
};

/// The result of one phase of direct and reduced: velocity, impulses of the couplings, of the loops' rows, and of the
/// curves `apart`.
struct Exact {
  Eigen::VectorXd velocity, impulses, loops, apart;
};
struct Curve;
/// The convex minimum with all rows and the further curves `apart`.
Exact exact_phase(const Bounded& step, Phase phase, const std::vector<Curve>& apart);

/// pgs and tgs. Each sweep visits the couplings' rows and then the bounded rows, by (M55).
Solution bounded_pgs(const Bounded& step);
Solution bounded_tgs(const Bounded& step);

}  // namespace lockstep::reference
