// <contact>: a pair for each two colliders that may touch. SPDX-License-Identifier: Apache-2.0
#include <set>

#include "model/contact_pairs.h"
#include "model/softness_numbers.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {

void write_contacts(const Writing& writing) {
  const auto& [model, timestep, trees, layout, held, report, xml] = writing;
  const ContactPairs contacts = contact_pairs(model, trees);
  std::set<int> touching;
  if (!contacts.pairs.empty()) xml.open("contact");
  for (const ColliderPair& pair : contacts.pairs) {
    const int first = pair.swapped ? pair.second : pair.first, second = pair.swapped ? pair.first : pair.second;
    touching.insert({first, second});
    xml.open("pair")
        .set("geom1", model.colliders[static_cast<std::size_t>(first)].name)
        .set("geom2", model.colliders[static_cast<std::size_t>(second)].name);
    if (pair.friction > 0.0)
      xml.set("condim", "3").set("friction", numbers({pair.friction, pair.friction, 0.005, 0.0001, 0.0001}));
    else
      xml.set("condim", "1");
    xml.close();
    const std::string name = pair_name(model, pair);
    report.remark("contacts, soft in MuJoCo", name);
    if (pair.restitution > 0.0) report.warn("restitution of contacts, left out", name);
    if (!is_hard(pair.softness) || erp_of(pair.softness) != Hard().erp)
      report.warn("softness of contacts, left out: it is MuJoCo's", name);
  }
  if (!contacts.pairs.empty()) xml.close();
  for (std::size_t c = 0; c < model.colliders.size(); ++c) {
    const Collider& collider = model.colliders[c];
    if (!touching.contains(static_cast<int>(c)))
      report.remark("colliders that touch nothing, written as geoms that touch nothing", collider.name);
    else if (!collider.group.empty())
      report.remark("groups of colliders, written pair by pair", collider.name);
  }
}

}  // namespace lockstep::exporter::mjcf
