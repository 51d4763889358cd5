// Resolves chains of mimics and checks their rules. SPDX-License-Identifier: Apache-2.0
#include "mimics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "import/text.h"
#include "lockstep/error.h"

namespace lockstep::importer::urdf {
namespace {

constexpr std::size_t nobody = static_cast<std::size_t>(-1);

// What a joint follows: q = multiplier * q_leader + offset.
struct Relation {
  std::size_t leader = nobody;
  double multiplier = 1.0, offset = 0.0;
};

// outer(inner(q))
Relation composed(const Relation& outer, const Relation& inner) {
  return {inner.leader, outer.multiplier * inner.multiplier, outer.multiplier * inner.offset + outer.offset};
}

[[noreturn]] void refuse(const Joint& follower, const std::string& rule, const std::string& remedy) {
  throw ModelError("joint '" + follower.name + "'", rule, remedy);
}

std::vector<Relation> direct_relations(const std::vector<Mimic>& mimics, const Model& model) {
  std::unordered_map<std::string, std::size_t> index_of;
  std::vector<std::string> names;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    index_of.emplace(model.joints[j].name, j);
    names.push_back(model.joints[j].name);
  }
  std::vector<Relation> direct(model.joints.size());
  for (const Mimic& mimic : mimics) {
    const Joint& follower = model.joints[mimic.follower];
    const auto leader = index_of.find(mimic.leader);
    if (leader == index_of.end())
      refuse(follower, "mimics joint '" + mimic.leader + "', which does not exist",
             "correct the name" + exists(nearest(mimic.leader, names)));
    if (leader->second == mimic.follower) refuse(follower, "mimics itself", "name another joint, or remove the mimic");
    if (!model.joints[leader->second].moves())
      refuse(follower, "mimics joint '" + mimic.leader + "', which is fixed",
             "name a moving joint, or make this one fixed too");
    if (mimic.multiplier == 0.0)
      refuse(follower, "mimics joint '" + mimic.leader + "' with multiplier 0, so it would stand still",
             "give a multiplier, or make the joint fixed");
    direct[mimic.follower] = {leader->second, mimic.multiplier, mimic.offset};
  }
  return direct;
}

// The last leader of each follower's chain. The walk visits each joint at most twice, however long the chains are.
std::vector<Relation> last_relations(const std::vector<Relation>& direct, const Model& model) {
  std::vector<Relation> last(direct.size());
  std::vector<bool> on_path(direct.size(), false);
  std::vector<std::size_t> path;
  const auto follows = [](const Relation& relation) { return relation.leader != nobody; };
  for (std::size_t start = 0; start < direct.size(); ++start) {
    path.clear();
    std::size_t joint = start;
    for (; follows(direct[joint]) && !follows(last[joint]); joint = direct[joint].leader) {
      if (on_path[joint]) {
        std::vector<std::string> names;
        for (auto at = std::find(path.begin(), path.end(), joint); at != path.end(); ++at)
          names.push_back(model.joints[*at].name);
        names.push_back(model.joints[joint].name);
        refuse(model.joints[joint], "mimics in a circle: " + listed(names, " <- "),
               "let one of them lead the others without a mimic");
      }
      on_path[joint] = true;
      path.push_back(joint);
    }
    for (; !path.empty(); path.pop_back()) {
      const Relation& relation = direct[path.back()];
      const Relation& above = last[relation.leader];
      last[path.back()] = follows(above) ? composed(relation, above) : relation;
      on_path[path.back()] = false;
    }
  }
  return last;
}

void report_chain(std::size_t follower, const std::vector<Relation>& direct, const Relation& last, const Model& model,
                  Report& report) {
  if (direct[follower].leader == last.leader) return;
  std::string chain = model.joints[follower].name;
  int shown = 0;
  std::size_t between = direct[follower].leader;
  for (; between != last.leader && shown < 4; between = direct[between].leader, ++shown)
    chain += " <- " + model.joints[between].name;
  if (between != last.leader) chain += " <- ...";
  const std::string& leader = model.joints[last.leader].name;
  report.remark("chains of mimics resolved",
                fmt::format("{} <- {} is {:.6g} {} {} {:.6g}", chain, leader, last.multiplier, leader,
                            last.offset < 0.0 ? '-' : '+', std::abs(last.offset)));
}

}  // namespace

void couple_mimics(const std::vector<Mimic>& mimics, Model& model, Report& report) {
  const std::vector<Relation> direct = direct_relations(mimics, model);
  const std::vector<Relation> last = last_relations(direct, model);
  for (const Mimic& mimic : mimics) {
    const Relation& relation = last[mimic.follower];
    Joint& follower = model.joints[mimic.follower];
    const Joint& leader = model.joints[relation.leader];
    // 0 - x and not -x: an offset of 0 has no sign.
    model.couplings.push_back(Coupling::mimic(follower.name, leader.name, -relation.multiplier, 0.0 - relation.offset));
    follower.position = relation.offset;  // the leader starts at 0
    report_chain(mimic.follower, direct, relation, model, report);
    if (relation.offset != 0.0)
      report.remark("followers that start where their coupling puts them",
                    fmt::format("{} at {:.6g}", follower.name, relation.offset));
  }
}

}  // namespace lockstep::importer::urdf
