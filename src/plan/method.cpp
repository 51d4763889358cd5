// Which method a step uses, and why. SPDX-License-Identifier: Apache-2.0
#include "layout.h"
#include "lockstep/error.h"

namespace lockstep {

void choose_method(Program& program) {
  program.method = program.settings.method;
  const bool has_tendons = program.f64.tendons.count > 0;
  const bool varies = declared(program, Parameter::softness) || declared(program, Parameter::coupling_switch);
  int hard = 0;
  for (int c = 0; c < program.f64.couplings; ++c) hard += always_hard(program, c);
  std::string obstacle;
  if (declared(program, Parameter::gear_ratio) && !program.redundant.empty())
    obstacle = "gear ratios differ per environment, and some couplings are redundant";
  if (has_tendons && !obstacle.empty())
    throw SettingsError("per_environment", "does not fit tendons, which take eliminated couplings: " + obstacle,
                        "leave it out, or remove the tendons");
  if (has_tendons && program.method != Method::automatic && program.method != Method::reduced)
    throw SettingsError("method",
                        std::string(to_string(program.method)) +
                            " does not apply: tendons have no inertia of their own, which it needs",
                        "use reduced, or automatic");
  if (program.method == Method::reduced && !obstacle.empty())
    throw SettingsError("method", "reduced does not apply: " + obstacle, "use direct");
  if (program.method != Method::automatic) {
    program.method_reason = "as asked for";
  } else if (obstacle.empty() && (hard > 0 || program.f64.couplings == 0)) {
    program.method = Method::reduced;
    program.method_reason = hard > 0 ? "hard couplings hold exactly and cost least when their followers are eliminated"
                                     : "there is nothing to solve";
  } else {
    program.method = Method::direct;
    program.method_reason = !obstacle.empty() ? obstacle
                            : varies          ? "softness or switches of couplings differ per environment"
                                              : "no coupling is always hard";
  }
}

}  // namespace lockstep
