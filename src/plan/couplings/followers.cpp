// Which joints follow which, in what order couplings place them, and which cannot move. SPDX-License-Identifier:
// Apache-2.0
//
// The choice is that of the method reduced. It is made for couplings of every softness, so that it does not depend on
// the method.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "plan/layout.h"

namespace lockstep {
namespace {

// What elimination leaves of a number below this share of what went into it is only rounding.
constexpr double rounding_share = 1e-9;

// A sum, and the sum of the magnitudes that went into it.
struct Sum {
  double value = 0.0, size = 0.0;
  void add(double number) { value += number, size += std::abs(number); }
  bool vanishes() const { return std::abs(value) <= rounding_share * size; }
};

// q_follower = sum of share * q + offset + sum of part * C.
struct Form {
  std::map<int, double> shares;  // by joint in the solver's order: independent joints alone
  double offset = 0.0;
  std::map<int, double> parts;  // by coupling
};

struct Choice {
  std::map<int, Form> forms;   // by follower
  std::vector<int> couplings;  // that are not redundant
};

void add_times(std::map<int, Sum>& sums, const std::map<int, double>& numbers, double times) {
  for (const auto& [index, number] : numbers) sums[index].add(times * number);
}

std::map<int, double> left_of(const std::map<int, Sum>& sums) {
  std::map<int, double> left;
  for (const auto& [index, sum] : sums)
    if (!sum.vanishes()) left.emplace(index, sum.value);
  return left;
}

// The form without the follower `known`.
void substitute(Form& form, int known, const Form& by) {
  const auto share = form.shares.find(known);
  if (share == form.shares.end()) return;
  const double times = share->second;
  std::map<int, Sum> shares, parts;
  form.shares.erase(share);
  add_times(shares, form.shares, 1.0);
  add_times(shares, by.shares, times);
  add_times(parts, form.parts, 1.0);
  add_times(parts, by.parts, times);
  form.shares = left_of(shares), form.parts = left_of(parts);
  form.offset += times * by.offset;
}

// Gauss-Jordan elimination of the rows of the couplings, in the model's order. Those of curved followers come first.
template <class Takes>
Choice choose(const Program& program, const Takes& takes) {
  const Tables<double>& t = program.f64;
  Choice choice;
  std::vector<int> order(t.functions.placing.data, t.functions.placing.data + t.functions.placing.count);
  for (int c = 0; c < t.couplings; ++c)
    if (!is_curved(program, c)) order.push_back(c);
  for (const int c : order) {
    if (!takes(c)) continue;

    // The row in independent joints: forms stand for the followers that are known.
    std::map<int, Sum> row, parts;
    parts[c].add(1.0);
    double offset = t.offset[c];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
      const int joint = t.term_joint[k];
      const double ratio = t.term_value[k];
      const auto follower = choice.forms.find(joint);
      if (follower == choice.forms.end()) {
        row[joint].add(ratio);
        continue;
      }
      const Form& form = follower->second;
      add_times(row, form.shares, ratio);
      add_times(parts, form.parts, -ratio);
      offset += ratio * form.offset;
    }
    const std::map<int, double> left = left_of(row);
    if (left.empty()) continue;  // redundant

    // Its follower: the first joint, or the one with the largest coefficient.
    auto pivot = left.begin();
    for (auto other = left.begin(); other != left.end(); ++other)
      if (std::abs(other->second) > std::abs(pivot->second)) pivot = other;
    const auto first = left.find(t.term_joint[t.term_start[c]]);
    if (places_tendon(t, c) || (first != left.end() && is_curved(program, c)) ||
        (first != left.end() && std::abs(first->second) * follower_preference >= std::abs(pivot->second)))
      pivot = first;

    // The follower's form, which now stands for it in the forms before.
    Form form;
    for (const auto& [joint, ratio] : left)
      if (joint != pivot->first) form.shares.emplace(joint, -ratio / pivot->second);
    for (const auto& [coupling, part] : left_of(parts)) form.parts.emplace(coupling, part / pivot->second);
    form.offset = -offset / pivot->second;
    for (auto& [joint, other] : choice.forms) substitute(other, pivot->first, form);
    choice.forms.emplace(pivot->first, std::move(form));
    choice.couplings.push_back(c);
  }
  return choice;
}

// The couplings in an order in which each places one follower from joints that stand already. Those that wait for each
// other are left to be solved together.
Placing placing_of(const Program& program, const Choice& choice) {
  const Tables<double>& t = program.f64;
  Placing placing;
  std::vector<char> waits(t.joints, 0), is_curved_joint(t.joints, 0);
  for (const auto& [joint, form] : choice.forms) waits[joint] = 1;
  for (int i = 0; i < t.functions.placing.count; ++i)
    is_curved_joint[t.term_joint[t.term_start[t.functions.placing[i]]]] = 1;
  // A function places its own follower, and nothing else does.
  const auto may_place = [&](int c, int term) {
    return is_curved(program, c) ? term == t.term_start[c] : !is_curved_joint[t.term_joint[term]];
  };
  std::vector<int> remaining = choice.couplings;
  for (bool found = true; found;) {
    found = false;
    std::vector<int> later;
    for (const int c : remaining) {
      int waiting = 0, term = -1;
      for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
        if (waits[t.term_joint[k]]) ++waiting, term = k;
      if (waiting != 1 || !may_place(c, term)) {
        later.push_back(c);
        continue;
      }
      placing.turns.push_back({c, term});
      waits[t.term_joint[term]] = 0;
      found = true;
    }
    remaining = std::move(later);
  }
  placing.ring = std::move(remaining);
  for (int joint = 0; joint < t.joints; ++joint)
    if (waits[joint]) placing.ring_followers.push_back(joint);
  return placing;
}

// Joints that hard couplings leave one position, together with those that the same couplings lock.
std::vector<LockedJoints> locked_by(const Program& program, const Choice& hard) {
  const Tables<double>& t = program.f64;
  std::vector<std::pair<std::set<int>, std::set<int>>> groups;  // joints, couplings
  for (const auto& [joint, form] : hard.forms) {
    if (!form.shares.empty()) continue;
    std::pair<std::set<int>, std::set<int>> group{{t.dof[joint]}, {}};
    for (const auto& [coupling, part] : form.parts) group.second.insert(coupling);
    for (auto other = groups.begin(); other != groups.end();) {
      const bool shared = std::any_of(other->second.begin(), other->second.end(),
                                      [&](int coupling) { return group.second.count(coupling) > 0; });
      if (shared) group.first.merge(other->first), group.second.merge(other->second);
      other = shared ? groups.erase(other) : other + 1;
    }
    groups.push_back(std::move(group));
  }
  std::vector<LockedJoints> locked;
  for (const auto& [joints, couplings] : groups)
    locked.push_back({{joints.begin(), joints.end()}, {couplings.begin(), couplings.end()}});
  return locked;
}

}  // namespace

void choose_followers(Program& program) {
  const Tables<double>& t = program.f64;
  const auto may_be_hard = [&](int c) {
    const Softness& softness = program.model.couplings[c].softness;
    const SoftnessKind kind = kind_of(softness);
    return is_hard(softness) ||
           (declared(program, Parameter::softness) && (kind == SoftnessKind::hard || kind == SoftnessKind::erp_cfm));
  };

  // Followers of all couplings, of those that may be hard, and of those that always are.
  const Choice all = choose(program, [](int) { return true; });
  program.placing_all = placing_of(program, all);
  program.placing_hard = placing_of(program, choose(program, may_be_hard));
  program.locked = locked_by(program, choose(program, [&](int c) { return always_hard(program, c); }));

  // What users see: followers in the order of placing, and what they follow.
  program.following.resize(t.joints);
  const auto follows = [&](int joint) {
    const Form& form = all.forms.at(joint);
    program.follower_dofs.push_back(t.dof[joint]);
    Following& following = program.following[t.dof[joint]];
    following.offset = form.offset;
    for (const auto& [leader, share] : form.shares) following.leaders.push_back({t.dof[leader], share});
  };
  for (const Placing::Turn& turn : program.placing_all.turns) follows(t.term_joint[turn.term]);
  for (const int joint : program.placing_all.ring_followers) follows(joint);
  take_tangents(program);
  take_spatial_tangents(program);
  std::vector<char> is_follower(t.joints, 0);
  for (const int dof : program.follower_dofs) is_follower[dof] = 1;
  for (int dof = 0; dof < t.joints; ++dof)
    if (!is_follower[dof]) program.independent_dofs.push_back(dof);

  // Dofs that actions drive: all with a drive that can move, and independent joints where gains differ per environment.
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const int dof = program.dof_of_joint[j];
    if (dof < 0) continue;
    const Drive& drive = program.model.joints[j].drive;
    const bool has_drive = drive.kinematic || drive.kp > 0.0 || drive.kd > 0.0;
    const bool moves =
        !is_follower[dof] || !program.following[dof].leaders.empty() || is_spatial(t, program.solver_joint[j]);
    if (moves && (has_drive || (declared(program, Parameter::drive_gains) && !is_follower[dof])))
      program.driven_dofs.push_back(dof);
  }
}

bool leaves_out(const Program& program, const JointSet& bounds, const Joint& joint) {
  if (bounds.all) return true;
  if (std::find(bounds.names.begin(), bounds.names.end(), joint.name) != bounds.names.end()) return true;
  if (!bounds.followers || joint.kind == JointKind::tendon) return false;
  const std::size_t index = static_cast<std::size_t>(&joint - program.model.joints.data());
  const std::vector<int>& followers = program.follower_dofs;
  return std::find(followers.begin(), followers.end(), program.dof_of_joint.at(index)) != followers.end();
}

}  // namespace lockstep
