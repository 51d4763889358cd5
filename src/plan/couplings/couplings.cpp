// Couplings as linear forms over the joints, and which are redundant. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "model/tendons.h"
#include "plan/layout.h"

namespace lockstep {
namespace {

// A row that elimination leaves smaller than this share of its size is only rounding.
constexpr double rank_tolerance = 1e-9;

}  // namespace

bool declared(const Program& program, Parameter parameter) {
  return program.settings.per_environment.contains(parameter);
}

bool has_own_inertias(const Program& program) {
  return declared(program, Parameter::mass) || declared(program, Parameter::center_of_mass) ||
         declared(program, Parameter::inertia);
}

bool places_tendon(const Tables<double>& t, int coupling) {
  return std::find(t.tendons.data, t.tendons.data + t.tendons.count, coupling) != t.tendons.data + t.tendons.count;
}

bool always_hard(const Program& program, int coupling) {
  const Coupling& c = program.model.couplings[coupling];
  if (!is_hard(c.softness) || c.force_limit < infinity) return false;
  return places_tendon(program.f64, coupling) ||
         (!declared(program, Parameter::softness) && !declared(program, Parameter::coupling_switch));
}

bool is_redundant(const Program& program, int coupling) {
  for (int c : program.redundant)
    if (c == coupling) return true;
  return false;
}

bool is_absent(const Program& program, int coupling) {
  for (int c : program.absent)
    if (c == coupling) return true;
  return false;
}

void lay_out_couplings(Program& program) {
  const Model& model = program.model;
  Tables<double>& t = program.f64;
  std::vector<int> start{0}, joint, gear, tendons;
  std::vector<double> value, offset;
  int gear_row = 0;
  for (std::size_t c = 0; c < model.couplings.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    joint.push_back(program.solver_joint[model.joint_index(coupling.joint)]);
    gear.push_back(-1);
    value.push_back(1.0);
    for (const CouplingTerm& term : coupling.terms) {
      joint.push_back(program.solver_joint[model.joint_index(term.joint)]);
      gear.push_back(gear_row++);
      value.push_back(coupling.function ? -slope_at_start(model, coupling) : term.ratio);
    }
    start.push_back(static_cast<int>(joint.size()));
    offset.push_back(coupling.offset);
    if (tendon_of(coupling, model)) tendons.push_back(static_cast<int>(c));
    const Softness& softness = coupling.softness;
    if (is_absent(softness) && !declared(program, Parameter::softness)) program.absent.push_back(static_cast<int>(c));
  }
  t.couplings = static_cast<int>(model.couplings.size());
  t.term_start = program.storage.keep(std::move(start));
  t.term_joint = program.storage.keep(std::move(joint));
  t.term_gear = program.storage.keep(std::move(gear));
  t.term_value = program.storage.keep(std::move(value));
  t.offset = program.storage.keep(std::move(offset));
  t.tendons = program.storage.keep(std::move(tendons));
  lay_out_functions(program);
}

// Gaussian elimination of the hard rows in the model's order. Each row keeps a record of the rows that it came from.
void find_redundant_couplings(Program& program) {
  const Tables<double>& t = program.f64;
  const std::vector<std::string> names = coupling_names(program.model);
  struct Reduced {
    Eigen::VectorXd row, origin;
    double offset;
    int pivot;
  };
  std::vector<Reduced> basis;
  for (int c = 0; c < t.couplings; ++c) {
    // Nothing else places a tendon or a curved follower.
    if (!always_hard(program, c) || places_tendon(t, c) || is_curved(program, c)) continue;

    // The row less what earlier rows say already.
    Reduced r{Eigen::VectorXd::Zero(t.joints), Eigen::VectorXd::Unit(t.couplings, c), t.offset[c], 0};
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) r.row[t.term_joint[k]] += t.term_value[k];
    const double scale = r.row.cwiseAbs().maxCoeff();
    double offset_scale = std::abs(r.offset);
    for (const Reduced& b : basis) {
      const double factor = r.row[b.pivot] / b.row[b.pivot];
      if (factor == 0.0) continue;
      r.row -= factor * b.row;
      r.row[b.pivot] = 0.0;
      r.origin -= factor * b.origin;
      r.offset -= factor * b.offset;
      offset_scale = std::max(offset_scale, std::abs(factor * b.offset));
    }

    // What is left is a row of its own, or rounding: then the coupling follows from its origins.
    if (r.row.cwiseAbs().maxCoeff(&r.pivot) > rank_tolerance * scale) {
      basis.push_back(r);
      continue;
    }
    program.redundant.push_back(c);
    std::vector<int> sources;
    for (int i = 0; i < c; ++i)
      if (std::abs(r.origin[i]) > rank_tolerance) sources.push_back(i);
    program.follows_from.push_back(std::move(sources));
    // Offsets per environment may contradict each other at any time. Then the first ones hold, and the diagnostics
    // report the conflict.
    if (declared(program, Parameter::offset)) continue;
    if (std::abs(r.offset) <= rank_tolerance * std::max(offset_scale, scale)) continue;
    std::string others;
    for (int i : program.follows_from.back()) others += (others.empty() ? "'" : "', '") + names[i];
    throw ModelError(
        "coupling '" + names[c] + "'",
        fmt::format("contradicts couplings {}': together they leave an error of {:.6g} whatever the joints do", others,
                    std::abs(r.offset)),
        "correct an offset, remove one of them, or make one soft");
  }
}

}  // namespace lockstep
