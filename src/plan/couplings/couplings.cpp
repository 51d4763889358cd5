// Couplings as linear forms over the joints, and which are redundant. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "lockstep/error.h"
#include "model/by_name.h"
#include "plan/layout.h"
#include "plan/parts.h"

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

// These lists are in the model's order.
bool places_tendon(const Tables<double>& t, int coupling) {
  return std::binary_search(t.tendons.data, t.tendons.data + t.tendons.count, coupling);
}

bool always_hard(const Program& program, int coupling) {
  const Coupling& c = program.model.couplings[coupling];
  if (!is_hard(c.softness) || c.force_limit < infinity) return false;
  return places_tendon(program.f64, coupling) ||
         (!declared(program, Parameter::softness) && !declared(program, Parameter::coupling_switch));
}

bool is_redundant(const Program& program, int coupling) {
  return std::binary_search(program.redundant.begin(), program.redundant.end(), coupling);
}

bool is_absent(const Program& program, int coupling) {
  return std::binary_search(program.absent.begin(), program.absent.end(), coupling);
}

void lay_out_couplings(Program& program) {
  const Model& model = program.model;
  Tables<double>& t = program.f64;
  std::vector<int> start{0}, joint, gear, tendons;
  std::vector<double> value, offset;
  int gear_row = 0;
  const ByName joints(model.joints);
  for (std::size_t c = 0; c < model.couplings.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    const int first = joints.find(coupling.joint);
    joint.push_back(program.solver_joint[first]);
    gear.push_back(-1);
    value.push_back(1.0);
    for (const CouplingTerm& term : coupling.terms) {
      joint.push_back(program.solver_joint[joints.find(term.joint)]);
      gear.push_back(gear_row++);
      value.push_back(coupling.function ? -slope_at_start(model, coupling) : term.ratio);
    }
    start.push_back(static_cast<int>(joint.size()));
    offset.push_back(coupling.offset);
    if (model.joints[first].kind == JointKind::tendon) tendons.push_back(static_cast<int>(c));
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

namespace {

// A row of a coupling, less what earlier rows say already.
struct Reduced {
  int coupling;
  std::map<int, double> row;  // by joint
  double offset;
  int pivot;
  std::vector<std::pair<int, double>> taken;  // earlier rows, and how many times each was taken away
};

// By coupling, its share in a row that comes after these. Most rows are never asked for it.
std::map<int, double> origin_of(const std::vector<Reduced>& basis, const Reduced& row) {
  std::map<int, std::map<int, double>> origins;  // by place in the basis, of all that the row depends on
  std::vector<int> open;
  const auto add_taken = [&](const Reduced& from) {
    for (const auto& [b, factor] : from.taken)
      if (origins.emplace(b, std::map<int, double>()).second) open.push_back(b);
  };
  for (add_taken(row); !open.empty();) {
    const int b = open.back();
    open.pop_back();
    add_taken(basis[static_cast<std::size_t>(b)]);
  }
  const auto sum_of = [&](const Reduced& from) {
    std::map<int, double> sum{{from.coupling, 1.0}};
    for (const auto& [b, factor] : from.taken)
      for (const auto& [coupling, share] : origins.at(b)) sum[coupling] -= factor * share;
    return sum;
  };
  for (auto& [b, origin] : origins) origin = sum_of(basis[static_cast<std::size_t>(b)]);
  return sum_of(row);
}

// Of the largest number, the first if several are as large.
std::pair<int, double> largest_of(const std::map<int, double>& row) {
  std::pair<int, double> largest{0, 0.0};
  for (const auto& [joint, number] : row)
    if (std::abs(number) > largest.second) largest = {joint, std::abs(number)};
  return largest;
}

// By coupling, whether it may follow from others. It does not where each of those that share joints, directly or
// through others, holds a joint that none before it has: elimination leaves that one's number as it is.
std::vector<char> may_follow(const Program& program, const std::vector<int>& couplings) {
  const Tables<double>& t = program.f64;
  Parts parts(t.joints);
  std::vector<char> seen(t.joints, 0), repeats(t.couplings, 0), in_part(t.joints, 0), result(t.couplings, 0);
  for (const int c : couplings) {
    double scale = 0.0, largest_new = 0.0;
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
      const int joint = t.term_joint[k];
      scale = std::max(scale, std::abs(t.term_value[k]));
      if (!seen[joint]) largest_new = std::max(largest_new, std::abs(t.term_value[k]));
      seen[joint] = 1;
      parts.join(t.term_joint[t.term_start[c]], joint);
    }
    repeats[c] = !(largest_new > rank_tolerance * scale);
  }
  const auto part_of = [&](int c) { return parts.of(t.term_joint[t.term_start[c]]); };
  for (const int c : couplings)
    if (repeats[c]) in_part[part_of(c)] = 1;
  for (const int c : couplings) result[c] = in_part[part_of(c)];
  return result;
}

}  // namespace

// Gaussian elimination of the hard rows in the model's order. Each row keeps a record of the rows that it came from.
void find_redundant_couplings(Program& program) {
  const Tables<double>& t = program.f64;
  const std::vector<std::string> names = coupling_names(program.model);
  std::vector<Reduced> basis;
  std::vector<int> place(t.joints, -1);  // by joint: of the row whose pivot it is
  std::vector<int> hard;                 // nothing else places a tendon or a curved follower
  for (int c = 0; c < t.couplings; ++c)
    if (always_hard(program, c) && !places_tendon(t, c) && !is_curved(program, c)) hard.push_back(c);
  const std::vector<char> may = may_follow(program, hard);
  for (const int c : hard) {
    if (!may[c]) continue;

    // The row less what earlier rows say already. What they add are pivots of later ones.
    Reduced r{c, {}, t.offset[c], 0, {}};
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) r.row[t.term_joint[k]] += t.term_value[k];
    const double scale = largest_of(r.row).second;
    double offset_scale = std::abs(r.offset);
    std::set<int> pivots;  // places of rows whose pivots the row has
    for (const auto& [joint, number] : r.row)
      if (place[joint] >= 0) pivots.insert(place[joint]);
    while (!pivots.empty()) {
      const int p = *pivots.begin();
      pivots.erase(pivots.begin());
      const Reduced& b = basis[p];
      const auto own = r.row.find(b.pivot);
      const double factor = own->second / b.row.at(b.pivot);
      r.row.erase(own);
      if (factor == 0.0) continue;
      for (const auto& [joint, number] : b.row) {
        if (joint == b.pivot) continue;
        r.row[joint] -= factor * number;
        if (place[joint] > p) pivots.insert(place[joint]);
      }
      r.taken.push_back({p, factor});
      r.offset -= factor * b.offset;
      offset_scale = std::max(offset_scale, std::abs(factor * b.offset));
    }

    // What is left is a row of its own, or rounding: then the coupling follows from its origins.
    const auto [pivot, largest] = largest_of(r.row);
    if (largest > rank_tolerance * scale) {
      place[pivot] = static_cast<int>(basis.size());
      r.pivot = pivot;
      basis.push_back(std::move(r));
      continue;
    }
    program.redundant.push_back(c);
    std::vector<int> sources;
    for (const auto& [coupling, share] : origin_of(basis, r))
      if (coupling < c && std::abs(share) > rank_tolerance) sources.push_back(coupling);
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
