// SPDX-License-Identifier: Apache-2.0
#include "solid.h"

#include <cmath>
#include <stdexcept>
#include <vector>

namespace lockstep::importer {

const Hull& Solid::hull() const {
  if (!hull_) hull_ = hull_of(mesh_.vertices);
  return *hull_;
}

const Fitted& Solid::fitted(Fit fit, int most_corners) const {
  const auto key = std::make_pair(fit, most_corners);
  const auto found = fits_.find(key);
  return found != fits_.end() ? found->second
                              : fits_.emplace(key, importer::fitted(hull(), fit, most_corners)).first->second;
}

Inertia Solid::inertia(MeshRule rule) const {
  const auto known = inertias_.find(rule);
  return known != inertias_.end() ? known->second : inertias_.emplace(rule, made(rule)).first->second;
}

Mesh Solid::surface() const {
  if (mesh_.triangles.cols() > 0) return mesh_;
  std::vector<int> corners;
  for (const HullFace& face : hull().faces)
    for (std::size_t i = 1; i + 1 < face.corners.size(); ++i)
      corners.insert(corners.end(), {face.corners[0], face.corners[i], face.corners[i + 1]});
  return {hull().corners,
          Eigen::Map<const Eigen::Matrix3Xi>(corners.data(), 3, static_cast<Eigen::Index>(corners.size() / 3))};
}

Inertia Solid::made(MeshRule rule) const {
  constexpr double least = 1e-15;  // m^3 or m^2, as in MuJoCo
  if (rule == MeshRule::convex) return solid_of(hull());
  if (rule == MeshRule::exact && !is_closed())
    throw std::invalid_argument("is not closed, so it has no exact inertia: an edge has not one triangle on each side");
  const Inertia inertia = inertia_of(surface(), rule);
  if (inertia.mass < -least) throw std::invalid_argument("is inside out: its triangles turn the wrong way");
  if (!(inertia.mass > least)) throw std::invalid_argument("has no volume");
  return inertia;
}

bool Solid::is_closed() const {
  if (!is_closed_) is_closed_ = mesh_.triangles.cols() == 0 || importer::is_closed(mesh_);
  return *is_closed_;
}

double Solid::volume() const {
  if (!volume_) volume_ = std::abs(signed_volume(surface()));
  return *volume_;
}

double Solid::share_of_hull() const { return volume() / solid_of(hull()).mass; }

double Solid::size() const {
  return (hull().corners.rowwise().maxCoeff() - hull().corners.rowwise().minCoeff()).maxCoeff();
}

}  // namespace lockstep::importer
