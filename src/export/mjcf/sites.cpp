// SPDX-License-Identifier: Apache-2.0
#include "sites.h"

#include <algorithm>

#include "bodies.h"
#include "export/names.h"

namespace lockstep::exporter::mjcf {

std::string world_link(const Model& model) {
  for (const Root& root : model.roots)
    if (stands_for_world(root, model)) return root.link;
  return "";
}

std::string find_site(const Model& model, const std::string& link, const Eigen::Vector3d& at) {
  const std::string on = link.empty() ? world_link(model) : link;
  const auto found = std::find_if(model.sites.begin(), model.sites.end(), [&](const Site& site) {
    return site.link == on && Eigen::Vector3d(site.pose.translation()) == at;
  });
  return found == model.sites.end() ? "" : found->name;
}

std::string site_at(const std::string& link, const Eigen::Vector3d& at, const std::string& wanted, Model& model) {
  if (const std::string found = find_site(model, link, at); !found.empty()) return found;
  Names names;
  for (const Site& site : model.sites) names.take(site.name);
  Site site{names.take(wanted), link.empty() ? world_link(model) : link};
  site.pose.translation() = at;
  model.sites.push_back(site);
  return site.name;
}

}  // namespace lockstep::exporter::mjcf
