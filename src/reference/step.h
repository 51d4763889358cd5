// The reference's step, each method in its plainest form. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "couplings.h"
#include "lockstep/step.h"
#include "mechanism.h"

namespace lockstep::reference {

/// What a step knows before any coupling is solved. v means all generalised velocities, those of a floating root along
/// the axes that it has at the start: inertial axes, in which its velocity is stepped.
struct Stage {
  Stage(const Mechanism& mechanism, double h, const State& state, const Inputs& inputs);

  double h;     ///< the step
  State state;  ///< at its start
  Couplings couplings;
  Eigen::MatrixXd mass;        ///< M
  Eigen::VectorXd bias;        ///< c, at constant joint velocities and a constant velocity of the root in the world
  Eigen::MatrixXd implicit;    ///< A = M + diag(a + h (d + kd) + h^2 kp)
  Eigen::MatrixXd inverse;     ///< A^-1
  Eigen::VectorXd free;        ///< v*, where the couplings take no impulse
  Eigen::MatrixXd jacobian;    ///< J over v
  Eigen::MatrixXd response;    ///< K = J A^-1 J^T; its diagonal are the r of (15)
  Eigen::VectorXd inertia;     ///< r of each coupling for (26), (27): with M + diag(a) instead of A
  Eigen::VectorXd error;       ///< C at the start of the step
  std::vector<Row> rows;       ///< erp and cfm at steps of h
  Eigen::VectorXd correction;  ///< b = erp C / h, (8)
};

/// What a method makes of it.
struct Solution {
  Eigen::VectorXd position_velocity;  ///< mean velocity over the step, which moves the positions
  Eigen::VectorXd velocity;           ///< at its end
  Eigen::VectorXd impulses;           ///< of all couplings over the step, velocity iterations included
};
Solution pgs(const Stage& stage, const StepSettings& settings);
Solution tgs(const Stage& stage, const StepSettings& settings);
Solution direct(const Stage& stage, const StepSettings& settings);
Solution reduced(const Stage& stage, const StepSettings& settings);

/// pgs with (18) to the letter: rows do not know the impulse that they have applied, so that a soft one hardens
/// with every visit. To show why the rows here have a memory; no Method uses it.
Solution literal_18(const Stage& stage, const StepSettings& settings);

struct Step {
  State state;
  Eigen::VectorXd impulses;
  Stage stage;
};
/// One step of settings.dt. The method must be named: automatic is refused (SettingsError).
Step step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs);

/// The state that a solution leads to: moved, and the root's twist in its new axes.
Step finished(const Mechanism& mechanism, Stage stage, Solution solution);

/// Shared by pgs and tgs: one visit to a row, velocity and impulse updated.
void visit(const Stage& stage, int i, double b, double cfm, double& impulse, Eigen::VectorXd& v);
/// Shared by pgs and tgs: the sweeps after the position update. Hard rows drop their bias b, soft ones keep all.
void velocity_sweeps(const Stage& stage, int count, const std::vector<Row>& rows, const Eigen::VectorXd& b,
                     Eigen::VectorXd& impulses, Eigen::VectorXd& v);

}  // namespace lockstep::reference
