// The exactly constrained continuous motion. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <functional>

#include "mechanism.h"

namespace lockstep::reference {

/// Sets what acts at time t; called with the model's inputs.
using InputsOverTime = std::function<void(double t, Inputs& inputs)>;

/// The model's inputs, held.
inline void held(double, Inputs&) {}

struct Motion {
  Eigen::VectorXd times;      ///< 0, interval, 2 interval, ...
  Eigen::MatrixXd positions;  ///< [time][dof]
  State end;                  ///< at the last time
  double error = 0.0;         ///< of the positions, largest, by Richardson's estimate (0 where none was made)
};

/// dv/dt of the motion that keeps all hard couplings exactly, found in the null space of their J. Soft couplings
/// act with the kp and kd of their springs, (26) and (27); softness by erp and cfm means nothing without a step,
/// so it is refused (SettingsError).
Eigen::VectorXd acceleration(const Mechanism& mechanism, const State& state, const Inputs& inputs);

/// Runge-Kutta 4 with `steps` steps per interval. The start must lie on the hard couplings; its velocity is moved
/// onto them as a collision would, by the impulses of the couplings.
Motion integrate(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs, double interval,
                 int intervals, int steps);

/// The same with the error: steps and 2 steps per interval, the finer motion is returned.
Motion integrate_with_error(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs,
                            double interval, int intervals, int steps);

}  // namespace lockstep::reference
