// <contact>: a pair for each two colliders that may touch. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <optional>
#include <set>

#include "body_response.h"
#include "model/contact_pairs.h"
#include "model/softness_numbers.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {
namespace {

// By direct numbers, at a constant impedance d (M165): k and c times (1 - d) A. An impedance near 1 is a large virtual
// mass, one near 0 a spring that MuJoCo's step has to resolve.
void write_spring(const Spring& spring, double response, double timestep, Xml& xml) {
  const double kp = spring.kp * response, kd = spring.kd * response;
  const double rest = std::clamp(std::min(0.25 / (timestep * timestep * kp), 0.5 / (timestep * kd)), 1e-4, 0.1);
  const double impedance = 1.0 - rest;
  xml.set("solref", numbers({-kp * rest, -kd * rest})).set("solimp", numbers({impedance, impedance, 0.001, 0.5, 2.0}));
}

}  // namespace

void write_contacts(const Writing& writing) {
  const auto& [model, timestep, trees, layout, held, report, xml] = writing;
  const ContactPairs contacts = contact_pairs(model, trees);
  std::set<int> touching;
  std::optional<std::vector<double>> responses;  // by link
  const auto response_of = [&](const ColliderPair& pair) {
    if (!responses) responses = body_responses(writing.model, writing.layout);
    double sum = 0.0;
    for (const int c : {pair.first, pair.second})
      if (const std::string& link = writing.model.colliders[static_cast<std::size_t>(c)].link; !link.empty())
        sum += (*responses)[static_cast<std::size_t>(writing.model.link_index(link))];
    return sum;
  };
  if (!contacts.pairs.empty()) xml.open("contact");
  for (const ColliderPair& pair : contacts.pairs) {
    const int first = pair.swapped ? pair.second : pair.first, second = pair.swapped ? pair.first : pair.second;
    touching.insert({first, second});
    xml.open("pair")
        .set("geom1", model.colliders[static_cast<std::size_t>(first)].name)
        .set("geom2", model.colliders[static_cast<std::size_t>(second)].name);
    if (pair.friction > 0.0)
      xml.set("condim", pair.rolling_friction > 0.0     ? "6"
                        : pair.torsional_friction > 0.0 ? "4"
                                                        : "3")
          .set("friction", numbers({pair.friction, pair.friction, pair.torsional_friction, pair.rolling_friction,
                                    pair.rolling_friction}));
    else
      xml.set("condim", "1");
    const std::string name = pair_name(model, pair);
    if (pair.restitution > 0.0) report.warn("restitution of contacts, left out", name);
    const auto* spring = std::get_if<Spring>(&pair.softness);
    const double response = spring && spring->kp > 0.0 ? response_of(pair) : 0.0;
    if (response > 0.0) {
      write_spring(*spring, response, timestep, xml);
      report.remark("contacts, as soft as here but for MuJoCo's virtual mass", name);
    } else if (!is_hard(pair.softness) || erp_of(pair.softness) != Hard().erp) {
      report.warn("softness of contacts, left out: it is MuJoCo's", name);
    } else {
      report.remark("contacts, soft in MuJoCo", name);
    }
    xml.close();
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
