// SPDX-License-Identifier: Apache-2.0
#include "repair.h"

#include <fmt/format.h>

#include <cmath>

#include "lockstep/error.h"
#include "model/inertia.h"
#include "model/tree.h"

namespace lockstep::urdf {
namespace {

void proper(double bound, const char* option) {
  if (!(bound >= 0.0) || !std::isfinite(bound))
    throw SettingsError(fmt::format("ImportOptions::{}", option), "is negative or no number", "give 0 for none");
}

void balance(Link& link, Report& report) {
  const Eigen::Vector3d moments = principal_moments(link.inertia);
  if (are_not_negative(moments) && keep_triangle_rule(moments)) return;
  link.inertia.about_center = Eigen::Matrix3d::Identity() * (moments.cwiseAbs().sum() / 3.0);
  report.remark("impossible inertias, taken as those of balls of the same mean moment", link.name);
}

}  // namespace

void repair_inertias(const ImportOptions& options, Model& model, Report& report) {
  proper(options.least_mass, "least_mass");
  proper(options.least_inertia, "least_inertia");
  if (options.least_mass == 0.0 && options.least_inertia == 0.0) return;
  for (Link& link : model.links) balance(link, report);

  const Tree tree(model);
  const std::vector<Inertia> bodies = rigid_bodies(model, tree);
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    if (tree.carrier[i] != static_cast<int>(i)) continue;
    Link& link = model.links[i];
    if (bodies[i].mass < options.least_mass) {
      link.inertia.mass += options.least_mass - bodies[i].mass;
      report.remark(fmt::format("masses raised to {:.4g} kg", options.least_mass), link.name);
    }
    const double least = principal_moments(rigid_bodies(model, tree)[i])[0];
    if (least >= options.least_inertia) continue;
    link.inertia.about_center += Eigen::Matrix3d::Identity() * (options.least_inertia - least);
    report.remark(fmt::format("inertias raised to {:.4g} kg m^2", options.least_inertia), link.name);
  }
}

}  // namespace lockstep::urdf
