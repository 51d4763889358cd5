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
#include "plan/limits.h"
#include "plan/parts.h"

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

long size_of(const Form& form) { return static_cast<long>(form.shares.size() + form.parts.size()); }

struct Choice {
  std::map<int, Form> forms;   // by follower
  std::vector<int> couplings;  // that are not redundant
};

// Which followers have a joint in their forms. Some of them may have had it once.
using Users = std::vector<std::vector<int>>;  // by joint

void add_times(std::map<int, Sum>& sums, const std::map<int, double>& numbers, double times) {
  for (const auto& [index, number] : numbers) sums[index].add(times * number);
}

std::map<int, double> left_of(const std::map<int, Sum>& sums) {
  std::map<int, double> left;
  for (const auto& [index, sum] : sums)
    if (!sum.vanishes()) left.emplace(index, sum.value);
  return left;
}

// Makes it the form without the follower `known`. Returns whether it had it.
bool substitute(Form& form, int known, const Form& by) {
  const auto share = form.shares.find(known);
  if (share == form.shares.end()) return false;
  const double times = share->second;
  form.shares.erase(share);
  form.offset += times * by.offset;
  std::map<int, Sum> shares, parts;
  add_times(shares, form.shares, 1.0);
  add_times(shares, by.shares, times);
  add_times(parts, form.parts, 1.0);
  add_times(parts, by.parts, times);
  form.shares = left_of(shares), form.parts = left_of(parts);
  return true;
}

// Gauss-Jordan elimination of the rows of the couplings: those of curved followers, other hard ones, soft ones, each in
// the model's order. So what is redundant beside a hard coupling and contradicts it is soft, where one of them is.
// Forms have no parts unless they are wanted: those of a long chain of followers are many.
template <class Takes>
Choice choose(const Program& program, bool wants_parts, const Takes& takes) {
  const Tables<double>& t = program.f64;
  Choice choice;
  Users users(t.joints);
  long entries = 0;
  std::vector<int> order(t.functions.placing.data, t.functions.placing.data + t.functions.placing.count);
  for (const bool hard : {true, false})
    for (int c = 0; c < t.couplings; ++c)
      if (!is_curved(program, c) && is_hard(program.model.couplings[c].softness) == hard) order.push_back(c);
  for (const int c : order) {
    if (!takes(c)) continue;

    // The row in independent joints: forms stand for the followers that are known.
    std::map<int, Sum> row, parts;
    if (wants_parts) parts[c].add(1.0);
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
    const auto use = [&](int follower) {
      for (const auto& [joint, share] : form.shares) users[joint].push_back(follower);
    };
    for (const int user : users[pivot->first]) {
      Form& other = choice.forms.at(user);
      entries -= size_of(other);
      if (substitute(other, pivot->first, form)) use(user);
      entries += size_of(other);
    }
    use(pivot->first);
    entries += size_of(form);
    require_room(program, entries, the_elimination);
    choice.forms.emplace(pivot->first, std::move(form));
    choice.couplings.push_back(c);
  }
  return choice;
}

// The couplings in an order in which each places one follower from joints that stand already. Those that wait for each
// other are left to be solved together. The couplings are gone through time and again; who places a follower lets
// others place theirs, later in the same round or in the next one.
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

  // By coupling of the choice: how many of its joints wait. By joint: these couplings.
  const auto count = choice.couplings.size();
  std::vector<int> waiting(count, 0);
  std::vector<std::vector<std::size_t>> with(t.joints);
  for (std::size_t i = 0; i < count; ++i)
    for (int k = t.term_start[choice.couplings[i]]; k < t.term_start[choice.couplings[i] + 1]; ++k)
      if (waits[t.term_joint[k]]) ++waiting[i], with[t.term_joint[k]].push_back(i);

  std::set<std::pair<int, std::size_t>> turns;  // that are due: round, coupling of the choice
  for (std::size_t i = 0; i < count; ++i)
    if (waiting[i] == 1) turns.insert({0, i});
  std::vector<char> places(count, 0);
  while (!turns.empty()) {
    const std::pair<int, std::size_t> turn = *turns.begin();
    turns.erase(turns.begin());
    const int c = choice.couplings[turn.second];
    int term = -1;
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
      if (waits[t.term_joint[k]]) term = k;
    if (term < 0 || !may_place(c, term)) continue;
    placing.turns.push_back({c, term});
    places[turn.second] = 1;
    waits[t.term_joint[term]] = 0;
    for (const std::size_t other : with[t.term_joint[term]])
      if (--waiting[other] == 1) turns.insert({other > turn.second ? turn.first : turn.first + 1, other});
  }
  for (std::size_t i = 0; i < count; ++i)
    if (!places[i]) placing.ring.push_back(choice.couplings[i]);
  for (int joint = 0; joint < t.joints; ++joint)
    if (waits[joint]) placing.ring_followers.push_back(joint);
  return placing;
}

// By coupling, whether it holds some joint that cannot move, perhaps through others.
std::vector<char> locking(const Program& program, const Choice& hard) {
  const Tables<double>& t = program.f64;
  Parts parts(t.joints);
  const auto first_joint = [&](int c) { return t.term_joint[t.term_start[c]]; };
  for (const int c : hard.couplings)
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k) parts.join(first_joint(c), t.term_joint[k]);
  std::vector<char> locks(t.joints, 0), locking(t.couplings, 0);
  for (const auto& [joint, form] : hard.forms)
    if (form.shares.empty()) locks[parts.of(joint)] = 1;
  for (const int c : hard.couplings) locking[c] = locks[parts.of(first_joint(c))];
  return locking;
}

// Joints that hard couplings leave one position, together with those that the same couplings lock.
std::vector<LockedJoints> locked_by(const Program& program, const Choice& by_hard) {
  const std::vector<char> locks = locking(program, by_hard);
  const Choice hard = choose(program, true, [&](int c) { return locks[c] != 0; });
  std::vector<std::pair<int, const Form*>> locked;
  for (const auto& [joint, form] : hard.forms)
    if (form.shares.empty()) locked.emplace_back(joint, &form);

  // Those that share a coupling are a group. Groups are in the order of their last joints.
  const auto count = static_cast<int>(locked.size());
  Parts groups(count);
  std::map<int, int> first_of;  // by coupling
  for (int i = 0; i < count; ++i)
    for (const auto& [coupling, part] : locked[i].second->parts)
      groups.join(first_of.emplace(coupling, i).first->second, i);
  std::vector<int> last(count);
  for (int i = 0; i < count; ++i) last[groups.of(i)] = i;
  std::map<int, std::pair<std::set<int>, std::set<int>>> sorted;  // by last joint: joints, couplings
  for (int i = 0; i < count; ++i) {
    auto& [joints, couplings] = sorted[last[groups.of(i)]];
    joints.insert(program.f64.dof[locked[i].first]);
    for (const auto& [coupling, part] : locked[i].second->parts) couplings.insert(coupling);
  }
  std::vector<LockedJoints> result;
  for (const auto& [place, group] : sorted)
    result.push_back({{group.first.begin(), group.first.end()}, {group.second.begin(), group.second.end()}});
  return result;
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
  const Choice all = choose(program, false, [](int) { return true; });
  const auto choice_of = [&](const auto& takes) {
    bool takes_all = true;
    for (int c = 0; c < t.couplings; ++c) takes_all = takes_all && takes(c);
    return takes_all ? all : choose(program, false, takes);
  };
  program.placing_all = placing_of(program, all);
  program.placing_hard = placing_of(program, choice_of(may_be_hard));
  program.locked = locked_by(program, choice_of([&](int c) { return always_hard(program, c); }));

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
  const int dof = program.dof_of_joint.at(index);
  return dof >= 0 && !std::binary_search(program.independent_dofs.begin(), program.independent_dofs.end(), dof);
}

}  // namespace lockstep
