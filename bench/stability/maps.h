// The maps: two parameters swept at a time, and the mechanism at each point. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lockstep/model.h"
#include "lockstep/step.h"

namespace lockstep::stability {

/// What is run at one point of a map, but for the method.
struct Setup {
  Model model;  ///< in its start; passive, so that its energy has a bound
  double dt = 1.0 / 240;
  int sweeps = 4;  ///< 0: the method makes none
};

struct Axis {
  std::string name;            ///< of its column in the file
  std::vector<double> values;  ///< ascending, SI units
  /// True where the parameter changes no table of the Plan, so that its values are environments of one Batch.
  bool in_environments = false;
};

enum class Judge {
  energy_and_errors,  ///< hard couplings: energy in its budget, errors at the end
  closed_form,        ///< equal soft couplings on a star of sliders: the motion of implicit Euler, (M32)
};

struct Map {
  std::string name;
  Axis x, y;                     ///< x is in_environments only where y is
  ParameterSet per_environment;  ///< what differs along an axis in_environments; starts may differ undeclared
  Judge judge = Judge::energy_and_errors;
  std::function<Setup(double x, double y)> at;

  /// direct and reduced do not sweep: they are run once and written with 0 sweeps.
  bool sweeps() const { return x.name == "sweeps"; }
};

/// All of them; `quick`: every fourth value of each axis.
std::vector<Map> all_maps(bool quick);

}  // namespace lockstep::stability
