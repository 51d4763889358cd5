// The plans that kernels are generated for. SPDX-License-Identifier: Apache-2.0
#include "plans.h"

#include <stdexcept>

#include "bounded_scenes.h"
#include "plan/program.h"
#include "reference/random_bounds.h"

namespace lockstep::generated {
namespace {

constexpr Method methods[] = {Method::reduced, Method::direct, Method::pgs, Method::tgs};

Method method_in(const std::string& name) {
  for (const Method method : methods)
    if (name.find(lockstep::to_string(method)) != std::string::npos) return method;
  throw std::invalid_argument("no method in the name " + name);
}

// All parameters that may differ per environment, without a softness in tgs: only the tables take that.
ParameterSet fields(Method method, const Model& model) {
  ParameterSet set;
  for (int p = 0; p < parameter_count; ++p)
    if (const auto parameter = static_cast<Parameter>(p); contract::all_parameters(method, model).contains(parameter) &&
                                                          !(method == Method::tgs && parameter == Parameter::softness))
      set.insert(parameter);
  return set;
}

}  // namespace

Plan plan_of(const std::string& name) {
  const auto has = [&](const char* word) { return name.find(word) != std::string::npos; };
  Model model;
  StepSettings settings{.integrator = Integrator::euler};
  if (has("random_") || has("deep_") || has("forest_")) {
    scenes::RandomOptions options;
    options.min_dofs = has("deep_") ? 12 : 1, options.max_dofs = has("deep_") ? 14 : 8;
    if (has("forest_")) options.min_trees = 2, options.max_trees = 4;
    options.gravity_shares = !has("_limits");  // with both, rounding moves some steps farther than targets differ
    options.redundant = false;                 // reduced refuses redundant couplings with gear ratios per environment
    options.max_tendons = has("_tendons") ? 3 : 0;
    const auto seed = std::stoull(name.substr(name.find('_') + 1));
    model = scenes::random_model(seed, options);
    if (has("_limits")) {
      model = physics::random_bounds(seed, settings.dt, options);
      for (Joint& joint : model.joints)  // servos that are limited in sweeps have no code
        if (!has("_efforts")) joint.effort_limit = infinity;
    }
    settings.method = methods[seed % 4];
  } else {
    model = scenes::scene(name.substr(0, name.find('_'))).model;
    settings.method = method_in(name);
  }
  for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
    if (has(lockstep::to_string(integrator))) settings.integrator = integrator;
  settings.stage_inputs = has("_inputs");
  if (has("_soft"))
    for (Coupling& coupling : model.couplings) coupling.softness = Frequency{60.0, 1.0};
  if (has("_bounds")) model = contract::bounded(model), settings.record_diagnostics = true;
  if (has("_fields")) {
    settings.per_environment = fields(settings.method, model);
    settings.record_impulses = settings.integrator == Integrator::euler;
  }
  Plan plan = compile(model, settings);
  if (has("deep_") && !program_of(plan).f64.articulated.used()) throw std::logic_error(name + " is not deep enough");
  return plan;
}

}  // namespace lockstep::generated
