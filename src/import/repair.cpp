// Repairs of inertias, body by body. SPDX-License-Identifier: Apache-2.0
#include "repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "model/inertia.h"
#include "model/trees.h"

namespace lockstep::importer {
namespace {

void proper(double bound, const char* option) {
  if (!(bound >= 0.0) || !std::isfinite(bound))
    throw SettingsError(fmt::format("ImportOptions::{}", option), "is negative, infinite or NaN",
                        "give a number above 0, or 0 to repair nothing");
}

// What to add to a tensor so that change(principal moments) are its moments. As their axes stay, this is the least
// change in the norm of the tensor if it is the least in the moments.
template <class Change>
Eigen::Matrix3d change_of(const Eigen::Matrix3d& tensor, Change change) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(tensor);
  const Eigen::Vector3d& moments = principal.eigenvalues();
  return principal.eigenvectors() * (change(moments) - moments).asDiagonal() * principal.eigenvectors().transpose();
}

// The rigid bodies of a model.
class Bodies {
 public:
  Bodies(Model& model, Report& report) : model_(model), report_(report), trees_(model) {}

  // use(first link, the body's inertia in its frame, the links of the body)
  template <class Use>
  void each(Use use) {
    const std::vector<Inertia> sums = rigid_bodies(model_, trees_);
    std::vector<std::vector<std::size_t>> members(sums.size());
    for (std::size_t i = 0; i < sums.size(); ++i) members[static_cast<std::size_t>(trees_.carrier[i])].push_back(i);
    for (std::size_t i = 0; i < sums.size(); ++i)
      if (!members[i].empty()) use(i, sums[i], members[i]);
  }

  // Adds to the tensor of one link what the body needs, which is in the axes of the body's first link.
  void add(std::size_t link, const Eigen::Matrix3d& tensor) {
    const Eigen::Matrix3d turn = trees_.in_carrier[link].linear();
    model_.links[link].inertia.about_center += turn.transpose() * tensor * turn;
  }

  bool fill_from_shapes(double density, const std::unordered_map<std::string, LinkExtras>& extras);
  void balance();
  void raise_masses(double least);
  void raise_inertias(double least);

 private:
  // A bolted root's inertia matters only if it floats later.
  void changed(const std::string& how, std::size_t link) {
    trees_.is_bolted(static_cast<int>(link)) ? report_.remark(how + ", of a bolted root", model_.links[link].name)
                                             : report_.warn(how, model_.links[link].name);
  }

  std::size_t heaviest(const std::vector<std::size_t>& links) const {
    return *std::max_element(links.begin(), links.end(), [&](std::size_t a, std::size_t b) {
      return model_.links[a].inertia.mass < model_.links[b].inertia.mass;
    });
  }

  Model& model_;
  Report& report_;
  Trees trees_;
};

bool Bodies::fill_from_shapes(double density, const std::unordered_map<std::string, LinkExtras>& extras) {
  bool are_read = true;
  each([&](std::size_t, const Inertia& body, const std::vector<std::size_t>& links) {
    const bool is_missing = body.mass == 0.0 && body.about_center.isZero(0.0);
    for (const std::size_t i : links) {
      Link& link = model_.links[i];
      const auto found = extras.find(link.name);
      if (found == extras.end()) continue;
      const auto& [lacks_mass, lacks_tensor, shapes] = found->second;
      if (!is_missing && !lacks_mass && !lacks_tensor) {
        report_.not_used("collision", shapes.collisions);
        continue;
      }
      if (shapes.meshes > 0) report_.warn(unused_meshes, link.name);
      Inertia made = shapes.solid;
      for (const auto& mesh_solid : shapes.mesh_solids)
        are_read &= report_.attempt([&] { made = made + mesh_solid(); });
      if (!(made.mass > 0.0)) continue;
      made.mass *= density;
      made.about_center *= density;
      if (is_missing)
        link.inertia = made;
      else if (lacks_mass)
        link.inertia.mass = made.mass;
      else
        link.inertia.about_center = made.about_center * (link.inertia.mass / made.mass);
      changed(fmt::format("inertia from collision shapes of {:.6g} kg/m^3", density), i);
    }
  });
  return are_read;
}

void Bodies::balance() {
  each([&](std::size_t, const Inertia& body, const std::vector<std::size_t>& links) {
    if (fault_of(body) == InertiaFault::none) return;
    const auto impossible = std::find_if(links.begin(), links.end(), [&](std::size_t i) {
      return fault_of(model_.links[i].inertia) != InertiaFault::none;
    });
    const std::size_t link = impossible == links.end() ? links.front() : *impossible;
    add(link, change_of(body.about_center, nearest_possible));
    changed("impossible inertias, changed to the nearest possible", link);
  });
}

void Bodies::raise_masses(double least) {
  each([&](std::size_t first, const Inertia& body, const std::vector<std::size_t>&) {
    if (body.mass >= least) return;
    model_.links[first].inertia.mass += least - body.mass;
    changed(fmt::format("masses raised to {:.4g} kg", least), first);
  });
}

// No moment exceeds the sum of the others afterwards if none did before.
void Bodies::raise_inertias(double least) {
  each([&](std::size_t, const Inertia& body, const std::vector<std::size_t>& links) {
    if (!(body.mass > 0.0) || principal_moments(body)[0] >= least) return;
    const std::size_t link = heaviest(links);
    add(link, change_of(body.about_center,
                        [&](const Eigen::Vector3d& moments) -> Eigen::Vector3d { return moments.cwiseMax(least); }));
    changed(fmt::format("inertias raised to {:.4g} kg m^2", least), link);
  });
}

// What the file says of inertia and no repair has changed.
void report_oddities(const Draft& draft, Report& report) {
  for (const Link& link : draft.model.links) {
    if (link.inertia.mass == 0.0 && !link.inertia.about_center.isZero(0.0))
      report.warn("inertia, but no mass", link.name);
    const auto extras = draft.extras.find(link.name);
    if (extras != draft.extras.end() && extras->second.lacks_tensor && link.inertia.about_center.isZero(0.0))
      report.warn("<inertial> without <inertia>, taken as a point mass", link.name);
    if (fault_of(link.inertia) != InertiaFault::none)
      report.remark("impossible inertias that are not judged alone: of a bolted root, or part of a possible body",
                    link.name);
  }
}

}  // namespace

bool repair_inertias(const ImportOptions& options, Draft& draft, Report& report) {
  proper(options.density, "density");
  proper(options.least_mass, "least_mass");
  proper(options.least_inertia, "least_inertia");
  for (const Link& link : draft.model.links) {
    const bool is_finite = link.inertia.about_center.allFinite() && link.inertia.center.allFinite();
    if (!(link.inertia.mass >= 0.0) || !is_finite) return true;  // nothing repairs that; Model::validate() reports it
  }
  Bodies bodies(draft.model, report);
  const bool are_read = !(options.density > 0.0) || bodies.fill_from_shapes(options.density, draft.extras);
  if (options.repair_inertias || options.least_mass > 0.0 || options.least_inertia > 0.0) bodies.balance();
  if (options.least_mass > 0.0) bodies.raise_masses(options.least_mass);
  if (options.least_inertia > 0.0) bodies.raise_inertias(options.least_inertia);
  report_oddities(draft, report);
  return are_read;
}

}  // namespace lockstep::importer
