// Followers that are functions of one joint, and what follows these. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "model/functions.h"
#include "model/rules.h"
#include "plan/layout.h"

namespace lockstep {
namespace {

// Stands for the slope in what a plan estimates, where it is 0 at the model's start.
constexpr double some_slope = 1.0;

}  // namespace

double slope_at_start(const Model& model, const Coupling& coupling) {
  const Joint& leader = model.joints[static_cast<std::size_t>(model.joint_index(coupling.terms[0].joint))];
  const double slope = curve_at(*coupling.function, leader.position).slope;
  return slope == 0.0 ? some_slope : slope;
}

bool is_curved(const Program& program, int coupling) {
  const FunctionTables<double>& f = program.f64.functions;
  return f.used() && f.curved[coupling] != 0;
}

bool shares_differ(const Program& program) {
  return declared(program, Parameter::gear_ratio) || program.f64.shares_change();
}

void lay_out_functions(Program& program) {
  Tables<double>& t = program.f64;
  const Model& model = program.model;
  std::vector<FunctionPlace> places;
  std::vector<int> of_coupling(static_cast<std::size_t>(t.couplings), -1), curved(of_coupling.size(), 0);
  std::vector<double> number, constant, piece;
  const auto append = [](std::vector<double>& to, const std::vector<double>& numbers) {
    const auto first = static_cast<int>(to.size());
    to.insert(to.end(), numbers.begin(), numbers.end());
    return first;
  };
  for (int c = 0; c < t.couplings; ++c) {
    const std::optional<Function>& function = model.couplings[static_cast<std::size_t>(c)].function;
    if (!function) continue;
    of_coupling[static_cast<std::size_t>(c)] = static_cast<int>(places.size());
    FunctionPlace place{static_cast<FunctionKind>(function->index()), c, 0, t.term_start[c] + 1, 0, 0, 0, 0};
    place.leader = t.term_joint[place.term];
    place.count = static_cast<int>(numbers_of(*function).size());
    place.first = append(number, numbers_of(*function));
    if (const auto* table = std::get_if<CamTable>(&*function)) {
      place.constant = append(constant, table->leader);
      place.piece = append(piece, pieces_of(*table));
    } else if (const auto* harmonic = std::get_if<Harmonic>(&*function)) {
      place.constant = append(constant, {harmonic->rate});
    }
    places.push_back(place);
  }
  if (places.empty()) return;
  std::vector<int> placing = curved_couplings(model);
  for (const int c : placing) curved[static_cast<std::size_t>(c)] = 1;
  t.functions.places = program.storage.keep(std::move(places));
  t.functions.of_coupling = program.storage.keep(std::move(of_coupling));
  t.functions.placing = program.storage.keep(std::move(placing));
  t.functions.curved = program.storage.keep(std::move(curved));
  t.functions.number = program.storage.keep(std::move(number));
  t.functions.constant = program.storage.keep(std::move(constant));
  t.functions.piece = program.storage.keep(std::move(piece));
}

void find_exact_followers(Program& program) {
  Tables<double>& t = program.f64;
  if (!t.shares_change()) return;
  std::vector<int> exact(static_cast<std::size_t>(t.reduction.followers), 0);
  const auto mark = [&](int joint) { exact[static_cast<std::size_t>(t.reduction.follower_of[joint])] = 1; };
  for (int i = 0; i < t.functions.placing.count; ++i) mark(t.term_joint[t.term_start[t.functions.placing[i]]]);
  for (int i = 0; i < t.spatial.tendons.count; ++i) mark(t.spatial.tendons[i].joint);
  t.reduction.exact = program.storage.keep(std::move(exact));
}

void take_tangents(Program& program) {
  const Tables<double>& t = program.f64;
  const Model& model = program.model;
  const auto index = [&](const std::string& joint) { return static_cast<std::size_t>(model.joint_index(joint)); };
  const std::vector<int> curved(t.functions.placing.data, t.functions.placing.data + t.functions.placing.count);
  std::vector<double> position, none(model.joints.size(), 0.0);
  for (const Joint& joint : model.joints) position.push_back(joint.position);
  place_curved(model, curved, position, none);

  // Joints in the order in which they stand: a curved follower's tangent is that of what it follows.
  for (const int c : curved) {
    const Coupling& coupling = model.couplings[static_cast<std::size_t>(c)];
    std::map<int, double> ratios;
    for (const CouplingTerm& term : coupling.terms) {
      const int leader = program.dof_of_joint[index(term.joint)];
      const double slope =
          coupling.function ? curve_at(*coupling.function, position[index(term.joint)]).slope : -term.ratio;
      const Following& further = program.following[static_cast<std::size_t>(leader)];
      if (further.leaders.empty()) ratios[leader] += slope;
      for (const Following::Leader& leads : further.leaders) ratios[leads.dof] += slope * leads.ratio;
    }
    Following& following = program.following[static_cast<std::size_t>(program.dof_of_joint[index(coupling.joint)])];
    following = {{}, position[index(coupling.joint)], true};
    for (const auto& [dof, ratio] : ratios) {
      following.leaders.push_back({dof, ratio});
      const auto leader = std::find(program.dof_of_joint.begin(), program.dof_of_joint.end(), dof);
      following.offset -= ratio * position[static_cast<std::size_t>(leader - program.dof_of_joint.begin())];
    }
  }
}

namespace {

// Where a joint can be: its range, or that of the one joint that it follows.
Range range_of(const Program& program, const std::string& name) {
  const Model& model = program.model;
  const Joint& joint = model.joints[static_cast<std::size_t>(model.joint_index(name))];
  Range range;
  if (has_range_of(program, joint) && !declared(program, Parameter::position_limits))
    range = {joint.lower, joint.upper};
  for (std::size_t c = 0; c < model.couplings.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    if (coupling.joint != name || coupling.terms.size() != 1 || coupling.function ||
        !always_hard(program, static_cast<int>(c)) || declared(program, Parameter::gear_ratio) ||
        declared(program, Parameter::offset))
      continue;
    const CouplingTerm& term = coupling.terms[0];
    const Range leader = range_of(program, term.joint);
    const auto [low, high] =
        std::minmax({-term.ratio * leader.lower - coupling.offset, -term.ratio * leader.upper - coupling.offset});
    range.lower = std::max(range.lower, low), range.upper = std::min(range.upper, high);
  }
  return range;
}

// What of a joint is an interval of its velocity, in words; null if nothing is.
const char* interval_of(const Program& program, const Joint& joint) {
  if (has_range_of(program, joint) && is_hard(joint.limit_softness)) return "a range";
  if (joint.velocity_limit < infinity && !leaves_out(program, program.settings.ignore.velocity_limits, joint))
    return "a velocity limit";
  return joint.drive.kinematic ? "a kinematic drive" : nullptr;
}

}  // namespace

// A bound of a follower is one of its leader, divided by the slope.
void check_bounds_of_functions(const Program& program) {
  const Tables<double>& t = program.f64;
  const Model& model = program.model;
  const std::vector<std::string> names = coupling_names(model);
  for (int i = 0; i < t.functions.placing.count; ++i) {
    const Coupling& placed = model.couplings[static_cast<std::size_t>(t.functions.placing[i])];
    const Joint& follower = model.joints[static_cast<std::size_t>(model.joint_index(placed.joint))];
    const char* const bound = interval_of(program, follower);
    if (!bound) continue;
    if (declared(program, Parameter::function))
      throw SettingsError("per_environment",
                          "has the function, but joint '" + follower.name + "' follows one and has " + bound +
                              ": whether its leader can be bounded in its place is known for the model's numbers alone",
                          "bound the leader, or leave out Parameter::function or the bound (StepSettings::ignore)");
    // All functions between the follower and what it follows in the end.
    std::vector<int> open{t.functions.placing[i]};
    while (!open.empty()) {
      const int c = open.back();
      open.pop_back();
      const Coupling& coupling = model.couplings[static_cast<std::size_t>(c)];
      require(!coupling.function || is_monotone(*coupling.function, range_of(program, coupling.terms[0].joint)),
              quoted("coupling", names[static_cast<std::size_t>(c)]),
              "is a function that rises and falls, or stands still, where joint '" + coupling.terms[0].joint +
                  "' can be, and joint '" + follower.name + "', which follows it, has " + bound,
              "bound the leader instead, or narrow its range to where the function only rises or only falls");
      for (const CouplingTerm& term : coupling.terms)
        for (int other = 0; other < t.couplings; ++other)
          if (t.functions.curved[other] && model.couplings[static_cast<std::size_t>(other)].joint == term.joint)
            open.push_back(other);
    }
  }
}

}  // namespace lockstep
