// Values that an application may write and that no Model could have. SPDX-License-Identifier: Apache-2.0
//
// They are looked for when step() is called, only in declared fields and in quaternions of roots.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "model/contact_pairs.h"
#include "model/inertia.h"
#include "model/softness_numbers.h"
#include "model/tendons.h"
#include "model/trees.h"
#include "plan/fields.h"
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

  S checked(S value) const {
    if (field == Parameter::drive_delay && value != std::floor(value)) return std::numeric_limits<S>::quiet_NaN();
    return field == Parameter::gear_ratio ? std::abs(value) : value;
  }
  bool holds(S value) const { return checked(value) >= least && checked(value) <= most; }
};

/// Rows of Parameter::loop_frame that are a quaternion: this one and the next three.
struct TurnRows {
  int row;
  std::string element;

  /// number(row) is the environment's. The quaternion need not be a unit one.
  template <class Number>
  bool hold(const Number& number) const {
    double squared = 0.0;
    for (int k = 0; k < 4; ++k) squared += static_cast<double>(number(row + k)) * static_cast<double>(number(row + k));
    return squared >= 1e-6 && squared <= 1e6;
  }
};

/// Links of one moving body. The sum of their masses must be above 0.
struct BodyLinks {
  std::vector<int> links;
  std::string element;
};

/// Links that move together, at their poses in one of them. Matter must be able to have their inertia.
template <class S>
struct InertiaRule {
  struct Part {
    int link;
    Eigen::Isometry3d pose;
    Inertia model;
  };
  std::vector<Part> parts;
  std::string element;

  /// number(parameter, row, model) is the environment's.
  template <class Number>
  bool holds(const Number& number) const {
    Inertia sum;
    for (const Part& part : parts) {
      Inertia inertia = part.model;
      inertia.mass = number(Parameter::mass, part.link, inertia.mass);
      if (part.model.mass > 0.0) inertia.about_center *= inertia.mass / part.model.mass;
      for (int k = 0; k < 3; ++k)
        inertia.center[k] = number(Parameter::center_of_mass, 3 * part.link + k, inertia.center[k]);
      for (int k = 0; k < 6; ++k) {
        double& entry = inertia.about_center(tensor_rows[k], tensor_columns[k]);
        entry = number(Parameter::inertia, 6 * part.link + k, entry);
        inertia.about_center(tensor_columns[k], tensor_rows[k]) = entry;
      }
      sum = parts.size() == 1 ? inertia : sum + transformed(inertia, part.pose);
    }
    if (!sum.about_center.allFinite()) return false;
    // Second moments that are clearly positive need no eigenvalues.
    const double trace = sum.about_center.trace();
    const Eigen::Matrix3d second = (0.5 - 1e-9) * trace * Eigen::Matrix3d::Identity() - sum.about_center;
    const double minor = second(0, 0) * second(1, 1) - second(1, 0) * second(1, 0);
    if (second(0, 0) > 0.0 && minor > 0.0 && second.determinant() > 0.0) return true;
    const Eigen::Vector3d moments = principal_moments(sum);
    const double scale = inertia_scale(sum.mass, moments), noise = sizeof(S) == 4 ? 1e-6 : inertia_noise;
    return moments[0] >= -noise * scale && triangle_excess(moments) <= inertia_rounding * scale;
  }
};

/// Rows of Parameter::position_limits: `row` and the next. The lower one must not be above the other.
struct LimitPair {
  int row;
  std::string element;
};

/// Fields that are infinite where the model has no limit.
inline bool is_limit(Parameter field) {
  return field == Parameter::position_limits || field == Parameter::velocity_limit ||
         field == Parameter::effort_limit || field == Parameter::motor_curve;
}

template <class S>
struct ValueRules {
  std::vector<ValueRule<S>> rows;
  std::vector<LimitPair> pairs;
  std::vector<TurnRows> turns;
  std::vector<InertiaRule<S>> inertias;
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

/// Limits may differ where the model has one.
template <class S>
void add_limit_rules(const Program& program, ValueRules<S>& rules) {
  constexpr S infinite = std::numeric_limits<S>::infinity(), largest = std::numeric_limits<S>::max();
  const auto add = [&](Parameter field, int row, bool limited, S least, S most, S none, const std::string& element,
                       const char* range) {
    if (!program.settings.per_environment.contains(field)) return;
    if (limited)
      rules.rows.push_back({field, row, least, most, element, range});
    else
      rules.rows.push_back({field, row, none, none, element, "infinite, as the model gives it no limit"});
  };
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const Joint& joint = program.model.joints[j];
    const int dof = program.dof_of_joint[j];
    if (dof < 0) continue;
    const std::string of = " of joint '" + joint.name + "'";
    const bool ranged = joint.lower > -infinity || joint.upper < infinity, ball = joint.kind == JointKind::ball;
    add(Parameter::position_limits, 2 * dof, ranged && !ball, -infinite, largest, -infinite, "lower limit" + of,
        "a number or -infinity");
    add(Parameter::position_limits, 2 * dof + 1, ranged, ball ? std::numeric_limits<S>::min() : -largest, infinite,
        infinite, "upper limit" + of, ball ? "above 0" : "a number or infinity");
    if (ranged && !ball && program.settings.per_environment.contains(Parameter::position_limits))
      rules.pairs.push_back({2 * dof, "joint '" + joint.name + "'"});
    add(Parameter::velocity_limit, dof, joint.velocity_limit < infinity, std::numeric_limits<S>::min(), infinite,
        infinite, "velocity limit" + of, "above 0");
    add(Parameter::effort_limit, dof, joint.effort_limit < infinity, S(0), infinite, infinite, "effort limit" + of,
        "0 or more");
    const bool is_motor = joint.drive.stall_effort < infinity;
    const auto add_curve = [&](int row, const std::string& element) {
      add(Parameter::motor_curve, row, is_motor, std::numeric_limits<S>::min(), largest, infinite, element + of,
          "a number above 0");
    };
    add_curve(2 * dof, "stall effort"), add_curve(2 * dof + 1, "no-load speed");
  }
}

/// Bodies whose inertia enters a step.
template <class S>
void add_inertia_rules(const Program& program, ValueRules<S>& rules) {
  const Trees trees(program.model);
  std::vector<InertiaRule<S>> bodies(program.model.links.size());
  for (std::size_t l = 0; l < program.model.links.size(); ++l) {
    if (program.f64.link[static_cast<int>(l)].body < 0) continue;
    const Link& link = program.model.links[l];
    InertiaRule<S>& body = bodies[static_cast<std::size_t>(trees.carrier[l])];
    body.element += (body.element.empty() ? "'" : ", '") + link.name + "'";
    body.parts.push_back({static_cast<int>(l), trees.in_carrier[l], link.inertia});
  }
  const bool given = program.settings.per_environment.contains(Parameter::inertia);
  for (InertiaRule<S>& body : bodies) {
    // Masses and centres of mass keep a possible inertia possible, but not a sum of which some part alone is not.
    const bool judged = given || std::any_of(body.parts.begin(), body.parts.end(), [](const auto& part) {
                          return fault_of(part.model) != InertiaFault::none;
                        });
    if (!body.parts.empty() && judged) rules.inertias.push_back(std::move(body));
  }
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

  // Couplings: ratios, and the two numbers of a softness by what they mean.
  const std::vector<std::string> names = coupling_names(model);
  int gear = 0;
  for (std::size_t c = 0; c < names.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    const std::string element = "coupling '" + names[c] + "'";
    const bool tied = places_tendon(program.f64, static_cast<int>(c));
    if (declares(Parameter::offset) && !coupling.function)
      rules.rows.push_back(
          {Parameter::offset, static_cast<int>(c), -largest, largest, "offset of " + element, "a number"});
    if (declares(Parameter::coupling_switch) && !tied)
      rules.rows.push_back({Parameter::coupling_switch, static_cast<int>(c), -largest, largest, "switch of " + element,
                            "a number, 0 where it is off"});
    for (const CouplingTerm& term : coupling.terms) {
      if (declares(Parameter::gear_ratio))
        rules.rows.push_back({Parameter::gear_ratio, gear, S(1e-9), S(1e9),
                              "ratio of joint '" + term.joint + "' in " + element, "1e-9 to 1e9 in magnitude"});
      ++gear;
    }
    if (tied) {  // nothing else says where it is
      const char* const always = "the tendon's own, as nothing else says where it is";
      const auto fixed = [&](Parameter field, int row, double value, const std::string& what) {
        if (declares(field))
          rules.rows.push_back({field, row, static_cast<S>(value), static_cast<S>(value), what + element, always});
      };
      fixed(Parameter::coupling_switch, static_cast<int>(c), 1.0, "switch of ");
      fixed(Parameter::softness, 2 * static_cast<int>(c), erp_of(coupling.softness), "erp of ");
      fixed(Parameter::softness, 2 * static_cast<int>(c) + 1, 0.0, "cfm of ");
      continue;
    }
    if (coupling.function) {
      const auto fixed = [&](Parameter field, int row, S value, const char* what) {
        if (declares(field))
          rules.rows.push_back({field, row, value, value, what + element, "that of the model, as the function has it"});
      };
      fixed(Parameter::gear_ratio, gear - 1, S(1), "ratio of ");
      fixed(Parameter::offset, static_cast<int>(c), S(0), "offset of ");
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

  // What must not be negative: numbers of joints, and friction of contacts.
  for (std::size_t dof = 0; dof < program.dof_names.size(); ++dof) {
    const int row = static_cast<int>(dof);
    const std::string joint = " of joint '" + program.dof_names[dof] + "'";
    if (declares(Parameter::drive_gains)) {
      add(Parameter::drive_gains, 2 * row, largest, "kp" + joint, "0 or more");
      add(Parameter::drive_gains, 2 * row + 1, largest, "kd" + joint, "0 or more");
    }
    if (declares(Parameter::damping)) add(Parameter::damping, row, largest, "damping" + joint, "0 or more");
    if (declares(Parameter::armature)) add(Parameter::armature, row, largest, "armature" + joint, "0 or more");
    if (declares(Parameter::stiffness)) add(Parameter::stiffness, row, largest, "stiffness" + joint, "0 or more");
    if (declares(Parameter::friction)) add(Parameter::friction, row, largest, "friction" + joint, "0 or more");
  }
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Joint& joint = model.joints[j];
    const int dof = program.dof_of_joint[j];
    if (dof < 0) continue;
    if (declares(Parameter::armature) && is_spatial(joint))
      add(Parameter::armature, dof, S(0), "armature of joint '" + joint.name + "'", "0, as it is a spatial tendon");
    if (declares(Parameter::drive_lag)) {
      const bool lags = joint.drive.lag > 0.0;
      add(Parameter::drive_lag, dof, lags ? largest : S(0), "lag of the drive of joint '" + joint.name + "'",
          lags ? "0 or more" : "0, as the model gives its drive none");
    }
    if (declares(Parameter::drive_delay))
      rules.rows.push_back(
          {Parameter::drive_delay, dof, S(0), static_cast<S>(joint.drive.delay),
           "delay of the drive of joint '" + joint.name + "'",
           "a whole number of steps from 0 to the model's Drive::delay, " + std::to_string(joint.drive.delay)});
  }
  for (std::size_t c = 0; declares(Parameter::contact_friction) && c < program.plan_contacts.size(); ++c)
    add(Parameter::contact_friction, static_cast<int>(c), static_cast<S>(most_friction),
        "friction of contact '" + program.plan_contacts[c].name + "'", "0 to 100");
  for (std::size_t c = 0; declares(Parameter::contact_restitution) && c < program.plan_contacts.size(); ++c)
    add(Parameter::contact_restitution, static_cast<int>(c), S(1),
        "restitution of contact '" + program.plan_contacts[c].name + "'", "0 to 1");

  // Places and sizes of colliders.
  for (std::size_t c = 0; program.f64.contacts.used() && c < model.colliders.size(); ++c) {
    const std::string element = " of collider '" + model.colliders[c].name + "'";
    for (int k = 0; k < 4 && declares(Parameter::collider_place); ++k)
      rules.rows.push_back(
          {Parameter::collider_place, 4 * static_cast<int>(c) + k, -largest, largest, "place" + element, "a number"});
    for (int k = 0; k < 3 && declares(Parameter::collider_size); ++k) {
      const int row = 3 * static_cast<int>(c) + k;
      const auto size = static_cast<S>(fields_of(program).value(Parameter::collider_size, row));
      const bool grows = !is_ground(model.colliders[c].shape.kind);
      rules.rows.push_back({Parameter::collider_size, row, grows ? size / S(most_growth) : size,
                            grows ? size * S(most_growth) : size, "size" + element,
                            grows ? "0.1 to 10 times the model's" : "the model's"});
    }
  }

  // Numbers of functions.
  for (int i = 0; declares(Parameter::function) && i < program.f64.functions.number.count; ++i)
    rules.rows.push_back(
        {Parameter::function, i, -largest, largest,
         "number of function '" +
             fields_of(program).names[static_cast<unsigned>(Parameter::function)][static_cast<std::size_t>(i)] + "'",
         "a number"});

  // Switches and frames of loops.
  for (std::size_t l = 0; declares(Parameter::loop_switch) && l < model.loops.size(); ++l)
    rules.rows.push_back({Parameter::loop_switch, static_cast<int>(l), -largest, largest,
                          "switch of loop '" + model.loops[l].name + "'", "a number, 0 where it is off"});
  for (std::size_t l = 0; declares(Parameter::loop_frame) && l < model.loops.size(); ++l) {
    const int row = 7 * static_cast<int>(l);
    const std::string element = "frame of loop '" + model.loops[l].name + "'";
    for (int k = 0; k < 7; ++k)
      rules.rows.push_back({Parameter::loop_frame, row + k, -largest, largest, element, "a number"});
    rules.turns.push_back({row + 3, element});
  }

  // Limits. Centres of mass and inertias may be any number, as long as the body as a whole is possible.
  add_limit_rules(program, rules);
  for (std::size_t l = 0; l < model.links.size(); ++l)
    for (const Parameter field : {Parameter::center_of_mass, Parameter::inertia})
      for (int count = field == Parameter::inertia ? 6 : 3, k = 0; declares(field) && k < count; ++k)
        rules.rows.push_back({field, count * static_cast<int>(l) + k, -largest, largest,
                              std::string(field == Parameter::inertia ? "inertia" : "centre of mass") + " of link '" +
                                  model.links[l].name + "'",
                              "a number"});
  if (program.f64.has_own_inertias()) add_inertia_rules(program, rules);

  // Masses. Where the model's body has one, its only link needs a mass, or several links together do.
  if (!declares(Parameter::mass)) return rules;
  const Tables<double>& t = program.f64;
  std::vector<BodyLinks> bodies(static_cast<std::size_t>(t.bodies));
  std::vector<double> mass(bodies.size(), 0.0);
  for (int l = 0; l < t.links; ++l) {
    const int body = t.link[l].body;
    if (body < 0) add(Parameter::mass, l, largest, "mass of link '" + model.links[l].name + "'", "0 or more");
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
