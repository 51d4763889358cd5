// What compile() makes of a scene: a cell of the page of combinations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "jit/compile.h"
#include "lockstep/error.h"
#include "lockstep/generate.h"
#include "plan/program.h"

namespace lockstep::combinations {

struct Cell {
  std::string text;      ///< engines, or "-"
  std::string obstacle;  ///< rule and remedy
};

inline Cell cell(const Model& model, StepSettings settings, Method method, Integrator integrator) {
  settings.method = method, settings.integrator = integrator;
  try {
    const Plan plan = compile(model, settings);
    std::string engines = "T";
    if (jit::plan_obstacle(program_of(plan)).empty()) engines += "C";
    if (kernel_hash(plan) != 0 && !program_of(plan).f64.contacts.used()) engines += "G";
    return {engines, ""};
  } catch (const Error& error) {
    return {"-", error.element() + ": " + error.rule() + "; " + error.remedy()};
  }
}

}  // namespace lockstep::combinations
