// Names of enumerators. SPDX-License-Identifier: Apache-2.0
#include "lockstep/enums.h"

#include "lockstep/model.h"

namespace lockstep {

const char* to_string(Method method) noexcept {
  switch (method) {
    case Method::pgs: return "pgs";
    case Method::tgs: return "tgs";
    case Method::direct: return "direct";
    case Method::reduced: return "reduced";
    case Method::automatic: break;
  }
  return "automatic";
}

const char* to_string(Integrator integrator) noexcept {
  switch (integrator) {
    case Integrator::euler: return "euler";
    case Integrator::leapfrog: return "leapfrog";
    case Integrator::extrapolated: return "extrapolated";
    case Integrator::runge_kutta: return "runge_kutta";
    case Integrator::automatic: break;
  }
  return "automatic";
}

const char* to_string(Parameter parameter) noexcept {
  constexpr const char* names[parameter_count] = {
      "gear_ratio",      "offset",         "softness",           "drive_gains",    "damping",   "mass",
      "gravity",         "link_wrench",    "coupling_switch",    "armature",       "stiffness", "friction",
      "position_limits", "velocity_limit", "effort_limit",       "center_of_mass", "inertia",   "contact_friction",
      "loop_switch",     "loop_frame",     "function",           "drive_delay",    "drive_lag", "motor_curve",
      "collider_place",  "collider_size",  "contact_restitution"};
  const auto index = static_cast<unsigned>(parameter);
  return index < parameter_count ? names[index] : "unknown";
}

const char* to_string(LoopKind kind) noexcept {
  switch (kind) {
    case LoopKind::point: return "point";
    case LoopKind::hinge: return "hinge";
    case LoopKind::slider: return "slider";
    case LoopKind::weld: break;
  }
  return "weld";
}

const char* to_string(FaultStage stage) noexcept {
  switch (stage) {
    case FaultStage::none: break;
    case FaultStage::values: return "values";
    case FaultStage::matrix: return "matrix";
    case FaultStage::guard: return "guard";
    case FaultStage::energy: return "energy";
    case FaultStage::state: return "state";
  }
  return "none";
}

const char* to_string(Fault fault) noexcept {
  switch (fault) {
    case Fault::none: break;
    case Fault::not_finite: return "not_finite";
    case Fault::diverged: return "diverged";
    case Fault::singular: return "singular";
    case Fault::too_fast: return "too_fast";
    case Fault::bad_value: return "bad_value";
    case Fault::bad_input: return "bad_input";
  }
  return "none";
}

}  // namespace lockstep
