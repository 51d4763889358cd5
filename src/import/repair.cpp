// Repairs of inertias. SPDX-License-Identifier: Apache-2.0
#include "repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "model/inertia.h"
#include "model/tree.h"

namespace lockstep::urdf {
namespace {

void proper(double bound, const char* option) {
  if (!(bound >= 0.0) || !std::isfinite(bound))
    throw SettingsError(fmt::format("ImportOptions::{}", option), "is negative, infinite or NaN",
                        "give 0 for no bound");
}

void balance(Link& link, Report& report) {
  const Eigen::Vector3d moments = principal_moments(link.inertia);
  if (are_not_negative(moments) && keep_triangle_rule(moments)) return;
  link.inertia.about_center = Eigen::Matrix3d::Identity() * std::max(moments.mean(), 0.0);
  report.remark("impossible inertias, taken as those of balls of the same mean moment", link.name);
}

void raise_masses(double least, const Tree& tree, Model& model, Report& report) {
  const std::vector<Inertia> bodies = rigid_bodies(model, tree);
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    if (tree.carrier[i] != static_cast<int>(i) || bodies[i].mass >= least) continue;
    model.links[i].inertia.mass += least - bodies[i].mass;
    report.remark(fmt::format("masses raised to {:.4g} kg", least), model.links[i].name);
  }
}

// By link: the heaviest of the links that form its body. A link without mass cannot have an inertia.
std::vector<std::size_t> heaviest_links(const Tree& tree, const Model& model) {
  std::vector<std::size_t> heaviest(tree.carrier.begin(), tree.carrier.end());
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    std::size_t& found = heaviest[static_cast<std::size_t>(tree.carrier[i])];
    if (model.links[i].inertia.mass > model.links[found].inertia.mass) found = i;
  }
  return heaviest;
}

void raise_inertias(double least, const Tree& tree, Model& model, Report& report) {
  const std::vector<Inertia> bodies = rigid_bodies(model, tree);
  const std::vector<std::size_t> heaviest = heaviest_links(tree, model);
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    if (tree.carrier[i] != static_cast<int>(i) || !(bodies[i].mass > 0.0)) continue;
    const double smallest = principal_moments(bodies[i])[0];
    if (smallest >= least) continue;
    Link& link = model.links[heaviest[i]];
    link.inertia.about_center += Eigen::Matrix3d::Identity() * (least - smallest);
    report.remark(fmt::format("inertias raised to {:.4g} kg m^2", least), link.name);
  }
}

}  // namespace

void repair_inertias(const ImportOptions& options, Model& model, Report& report) {
  proper(options.least_mass, "least_mass");
  proper(options.least_inertia, "least_inertia");
  if (options.least_mass == 0.0 && options.least_inertia == 0.0) return;
  for (const Link& link : model.links)
    if (link.inertia.mass < 0.0) return;  // no bound repairs that; Model::validate() reports it
  for (Link& link : model.links) balance(link, report);
  const Tree tree(model);
  if (options.least_mass > 0.0) raise_masses(options.least_mass, tree, model, report);
  if (options.least_inertia > 0.0) raise_inertias(options.least_inertia, tree, model, report);
}

}  // namespace lockstep::urdf
