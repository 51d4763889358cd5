// The reference's step, with each method as plain as possible. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "couplings.h"
#include "lockstep/step.h"
#include "mechanism.h"

namespace lockstep::reference {

/// What a step knows before any coupling is solved. v are all generalised velocities. Those of a floating root are
/// along its axes at the start of the step; these stay fixed during the step.
struct Stage {
  Stage(const Mechanism& mechanism, double h, const State& state, const Inputs& inputs);

  double h;     ///< the step
  State state;  ///< at its start
  Couplings couplings;
  Eigen::MatrixXd mass;        ///< M
  Eigen::VectorXd bias;        ///< c, for constant joint velocities and a constant velocity of the root in the world
  Eigen::MatrixXd implicit;    ///< A = M + diag(a + h (d + kd) + h^2 kp)
  Eigen::MatrixXd inverse;     ///< A^-1
  Eigen::VectorXd free;        ///< v*, the velocity if no coupling takes an impulse
  Eigen::MatrixXd jacobian;    ///< J over v
  Eigen::MatrixXd response;    ///< K = J A^-1 J^T; its diagonal is r of (15)
  Eigen::VectorXd inertia;     ///< r of each coupling for (26), (27): with M + diag(a) instead of A
  Eigen::VectorXd error;       ///< C at the start of the step
  std::vector<Row> rows;       ///< erp and cfm at steps of h
  Eigen::VectorXd correction;  ///< b = erp C / h, (8)
};

/// The result of a method.
struct Solution {
  Eigen::VectorXd position_velocity;   ///< mean velocity over the step, which moves the positions
  Eigen::VectorXd velocity;            ///< at its end
  Eigen::VectorXd impulses;            ///< of all couplings over the step, velocity iterations included
  Eigen::VectorXd loop_impulses = {};  ///< of the loops' rows (loops.h); absent where there are none
};
Solution pgs(const Stage& stage, const StepSettings& settings);
Solution tgs(const Stage& stage, const StepSettings& settings);
Solution direct(const Stage& stage, const StepSettings& settings);
Solution reduced(const Stage& stage, const StepSettings& settings);

/// pgs with (18) as it is written: rows forget the impulse that they have applied, so a soft row gets harder with every
/// visit. Tests use it to show why rows must know their impulse; no Method does.
Solution literal_18(const Stage& stage, const StepSettings& settings);

struct Step {
  State state;
  Eigen::VectorXd impulses;
  Stage stage;
  Eigen::VectorXd loop_impulses;
};
/// One step of settings.dt. Throws SettingsError for the method automatic, and for pgs and tgs with closed loops.
Step step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs);

/// The state at the end of the step: positions moved, and the root's twist in its new axes.
Step finished(const Mechanism& mechanism, Stage stage, Solution solution);

/// One visit of pgs or tgs to a row. Updates velocity and impulse.
void visit(const Stage& stage, int i, double b, double cfm, double& impulse, Eigen::VectorXd& v);
/// The sweeps of the velocity phase, of pgs and tgs. Hard rows lose their bias b; soft rows do not change.
void velocity_sweeps(const Stage& stage, int count, const std::vector<Row>& rows, const Eigen::VectorXd& b,
                     Eigen::VectorXd& impulses, Eigen::VectorXd& v);

}  // namespace lockstep::reference
