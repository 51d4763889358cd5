// Which method a step uses, and why. SPDX-License-Identifier: Apache-2.0
#include "layout.h"

namespace lockstep {

void choose_method(Program& program) {
  const StepSettings& s = program.settings;
  program.method = s.method;
  find_method_obstacles(program);
  for (const PlanObstacle& obstacle : program.obstacles)
    if (obstacle.axis == Axis::per_environment || obstacle.applies_to == to_string(s.method) ||
        obstacle.applies_to == to_string(s.integrator))
      refuse(obstacle);
  const PlanObstacle* const to_reduced = find_obstacle(program, Axis::method, to_string(Method::reduced));
  const bool varies = declared(program, Parameter::softness) || declared(program, Parameter::coupling_switch);
  int hard = program.f64.spatial.tendons.count;  // followers of which no coupling tells
  for (int c = 0; c < program.f64.couplings; ++c) hard += always_hard(program, c);
  if (program.method != Method::automatic) {
    program.method_reason = "as asked for";
  } else if (!to_reduced && (hard > 0 || program.f64.couplings == 0)) {
    program.method = Method::reduced;
    program.method_reason = hard > 0 ? "hard couplings hold exactly and cost least when their followers are eliminated"
                                     : "there is nothing to solve";
  } else {
    program.method = Method::direct;
    program.method_reason = to_reduced ? to_reduced->reason
                            : varies   ? "softness or switches of couplings differ per environment"
                                       : "no coupling is always hard";
  }
}

}  // namespace lockstep
