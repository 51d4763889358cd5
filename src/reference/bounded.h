// Steps with bounds, section 12 of docs/mathematics.md. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bounds.h"
#include "step.h"

namespace lockstep::reference {

/// A step of a model that has bounds; step() comes here for them. Throws std::logic_error for direct and reduced where
/// bounds contradict each other or the couplings, and for pgs and tgs where no choice of saturated servos is
/// consistent with the velocities that it leads to.
Step bounded_step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs);

/// What the methods start from. The stage's servos are those that act linearly or with a constant force.
struct Bounded {
  const Mechanism& mechanism;
  const StepSettings& settings;
  const Inputs& inputs;
  const Stage& stage;
};

/// Of one phase of direct and reduced: its velocity, the couplings' impulses and those of `apart`.
struct Exact {
  Eigen::VectorXd velocity, impulses, apart;
};
struct Curve;
/// The convex minimum with all rows and the curves `apart`.
Exact exact_phase(const Bounded& step, Phase phase, const std::vector<Curve>& apart);

/// pgs and tgs, bounded rows visited by (M55) after the couplings' in each sweep.
Solution bounded_pgs(const Bounded& step);
Solution bounded_tgs(const Bounded& step);

}  // namespace lockstep::reference
