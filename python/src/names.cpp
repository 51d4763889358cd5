// Enumerators and settings by their names. SPDX-License-Identifier: Apache-2.0
#include <iterator>

#include "convert.h"

namespace lockstep::python {
namespace {

// The enumerators are numbered from 0.
template <class Enum>
Enum enumerator_of(const char* setting, const std::string& name, int count) {
  Names<Enum> all;
  for (int i = 0; i < count; ++i) all.push_back({to_string(static_cast<Enum>(i)), static_cast<Enum>(i)});
  return one_of<SettingsError, Enum>(setting, name, all);
}

}  // namespace

Method method_of(const std::string& name) {
  return enumerator_of<Method>("method", name, static_cast<int>(Method::reduced) + 1);
}
Integrator integrator_of(const std::string& name) {
  return enumerator_of<Integrator>("integrator", name, static_cast<int>(Integrator::runge_kutta) + 1);
}
Target target_of(const std::string& name) {
  return enumerator_of<Target>("target", name, static_cast<int>(Target::neon) + 1);
}
Loops loops_of(const std::string& name) { return enumerator_of<Loops>("loops", name, 2); }
Fit fit_of(const std::string& name) { return enumerator_of<Fit>("fit", name, 4); }
Soft soft_of(const std::string& name) { return enumerator_of<Soft>("soft", name, 2); }

Engine engine_of(const std::string& name) {
  return enumerator_of<Engine>("engine", name, static_cast<int>(Engine::generated) + 1);
}
Parameter parameter_of(const std::string& name) { return enumerator_of<Parameter>("field", name, parameter_count); }

ContactSettings contact_settings_of(const std::string& name) {
  const Names<ContactSettings> all(std::begin(all_contact_settings), std::end(all_contact_settings));
  return one_of<SettingsError>("contact_settings", name, all);
}

}  // namespace lockstep::python
