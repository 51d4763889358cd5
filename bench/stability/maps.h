// The maps: two parameters that vary, and the mechanism at each point. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep::stability {

/// The run at one point of a map, without the method.
struct Setup {
  Model model;  ///< with its start; passive, so that its energy has a bound
  double dt = 1.0 / 240;
  int sweeps = 4;  ///< 0: the method does not sweep
};

struct Axis {
  std::string name;            ///< of its column in the file
  std::vector<double> values;  ///< ascending, SI units
  /// True if the parameter changes no table of the Plan, so that its values can be environments of one Batch.
  bool in_environments = false;
};

enum class Judge {
  energy_and_errors,  ///< hard couplings: by the energy, and by the errors at the end
  closed_form,        ///< equal soft couplings on a star of sliders: by the motion of implicit Euler, (M32)
};

struct Map {
  std::string name;
  Axis x, y;                     ///< x is in_environments only if y is
  ParameterSet per_environment;  ///< what differs along an axis in_environments, start states not included
  Judge judge = Judge::energy_and_errors;
  std::function<Setup(double x, double y)> at;

  /// True if x is the number of sweeps. direct and reduced do not sweep: they run once, and their rows say 0 sweeps.
  bool sweeps() const { return x.name == "sweeps"; }
};

/// All maps; `quick`: with every fourth value of each axis.
std::vector<Map> all_maps(bool quick);

}  // namespace lockstep::stability
