// Values that an application may write and that no Model could have. SPDX-License-Identifier: Apache-2.0
//
// They are looked for when step() is called, only in declared fields and in quaternions of roots.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "model/softness_numbers.h"
#include "plan/program.h"
#include "simd/wide.h"

namespace lockstep {

/// The range of one row of a declared field.
template <class S>
struct ValueRule {
  Parameter field;
  int row;
  S least, most;               ///< of the magnitude, for gear ratios
  std::string element, range;  ///< in words

  S checked(S value) const { return field == Parameter::gear_ratio ? std::abs(value) : value; }
  bool holds(S value) const { return checked(value) >= least && checked(value) <= most; }
};

/// Links of one moving body. The sum of their masses must be above 0.
struct BodyLinks {
  std::vector<int> links;
  std::string element;
};

template <class S>
struct ValueRules {
  std::vector<ValueRule<S>> rows;
  std::vector<BodyLinks> bodies;  ///< of several links, where masses differ and the model's are not all 0
};

/// Whether all numbers are within the range. Counts in integers of the numbers' size, so that the loop is vectorised.
template <class S, class Number>
bool all_within(std::ptrdiff_t first, std::ptrdiff_t last, S least, S most, const Number& number) {
  typename simd::IntegerOf<S>::type outside = 0;
  for (std::ptrdiff_t e = first; e < last; ++e) {
    const S value = number(e);
    outside |= (value >= least ? 0 : 1) | (value <= most ? 0 : 1);
  }
  return outside == 0;
}

template <class S>
ValueRules<S> value_rules(const Program& program) {
  constexpr S largest = std::numeric_limits<S>::max();
  const Model& model = program.model;
  const auto declares = [&](Parameter p) { return program.settings.per_environment.contains(p); };
  ValueRules<S> rules;
  const auto add = [&](Parameter field, int row, S most, const std::string& element, const char* range) {
    rules.rows.push_back({field, row, S(0), most, element, range});
  };
  const std::vector<std::string> names = coupling_names(model);
  int gear = 0;
  for (std::size_t c = 0; c < names.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    const std::string element = "coupling '" + names[c] + "'";
    for (const CouplingTerm& term : coupling.terms) {
      if (declares(Parameter::gear_ratio))
        rules.rows.push_back({Parameter::gear_ratio, gear, S(1e-9), S(1e9),
                              "ratio of joint '" + term.joint + "' in " + element, "1e-9 to 1e9 in magnitude"});
      ++gear;
    }
    if (!declares(Parameter::softness)) continue;
    const int row = 2 * static_cast<int>(c);
    switch (kind_of(coupling.softness)) {
      case SoftnessKind::hard:
      case SoftnessKind::erp_cfm: {
        const bool shared = program.method == Method::tgs && program.settings.iterations > 1;
        add(Parameter::softness, row, shared ? S(1) : std::nextafter(S(2), S(0)), "erp of " + element,
            shared ? "0 to 1, as sub-steps share it" : "0 to below 2");
        add(Parameter::softness, row + 1, largest, "cfm of " + element, "0 or more");
        break;
      }
      case SoftnessKind::spring:
        add(Parameter::softness, row, largest, "kp of " + element, "0 or more");
        add(Parameter::softness, row + 1, largest, "kd of " + element, "0 or more");
        break;
      case SoftnessKind::frequency:
        add(Parameter::softness, row, largest, "frequency of " + element, "0 or more");
        add(Parameter::softness, row + 1, largest, "damping ratio of " + element, "0 or more");
        break;
    }
  }
  for (std::size_t dof = 0; dof < program.dof_names.size(); ++dof) {
    const int row = static_cast<int>(dof);
    const std::string joint = " of joint '" + program.dof_names[dof] + "'";
    if (declares(Parameter::drive_gains)) {
      add(Parameter::drive_gains, 2 * row, largest, "kp" + joint, "0 or more");
      add(Parameter::drive_gains, 2 * row + 1, largest, "kd" + joint, "0 or more");
    }
    if (declares(Parameter::damping)) add(Parameter::damping, row, largest, "damping" + joint, "0 or more");
  }
  if (!declares(Parameter::mass)) return rules;
  const Tables<double>& t = program.f64;
  std::vector<BodyLinks> bodies(static_cast<std::size_t>(t.bodies));
  std::vector<double> mass(bodies.size(), 0.0);
  for (int l = 0; l < t.links; ++l) {
    const int body = t.link[l].body;
    if (body < 0) continue;
    bodies[body].links.push_back(l);
    bodies[body].element += (bodies[body].element.empty() ? "'" : ", '") + model.links[l].name + "'";
    mass[body] += model.links[l].inertia.mass;
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const bool alone = bodies[b].links.size() == 1 && mass[b] > 0.0;
    for (const int link : bodies[b].links) {
      add(Parameter::mass, link, largest, "mass of link '" + model.links[link].name + "'",
          alone ? "above 0" : "0 or more");
      if (alone) rules.rows.back().least = std::numeric_limits<S>::min();  // a denormal mass counts as 0
    }
    if (!alone && mass[b] > 0.0) rules.bodies.push_back(std::move(bodies[b]));
  }
  return rules;
}

}  // namespace lockstep
