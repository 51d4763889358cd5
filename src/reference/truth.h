// The exactly constrained continuous motion. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <functional>

#include "mechanism.h"

namespace lockstep::reference {

/// Sets the inputs at time t. `inputs` are the model's at the first call.
using InputsOverTime = std::function<void(double t, Inputs& inputs)>;

/// Keeps the model's inputs.
inline void held(double, Inputs&) {}

struct Motion {
  Eigen::VectorXd times;      ///< 0, interval, 2 interval, ...
  Eigen::MatrixXd positions;  ///< [time][dof]
  State end;                  ///< at the last time
  double error = 0.0;         ///< largest error of the positions, by Richardson's estimate; 0 if not estimated
};

/// dv/dt of the motion that satisfies all hard couplings and all loops exactly, found in the null space of the
/// couplings' J. Soft couplings act as springs with kp and kd, (26) and (27). Throws SettingsError for an ErpCfm, which
/// means nothing without a step, and for loops that yield or have a limit.
Eigen::VectorXd acceleration(const Mechanism& mechanism, const State& state, const Inputs& inputs);

/// Runge-Kutta 4 with `steps` steps per interval, after each of which the loops are closed. Throws SettingsError if the
/// start violates a hard coupling or a loop. Impulses of both make its velocity satisfy them.
Motion integrate(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs, double interval,
                 int intervals, int steps);

/// The same with the error. Runs `steps` and 2 `steps` per interval, and returns the finer motion.
Motion integrate_with_error(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs,
                            double interval, int intervals, int steps);

}  // namespace lockstep::reference
