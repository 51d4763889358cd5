// A mesh and what is made of it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <utility>

#include "fit.h"
#include "inertia.h"
#include "mesh.h"

namespace lockstep::importer {

/// A mesh where an element of a robot file puts it, and what is made of it: each at the first request, and once. One
/// thread.
class Solid {
 public:
  /// Without triangles it has those of its hull.
  explicit Solid(Mesh mesh) : mesh_(std::move(mesh)) {}

  /// These two throw std::invalid_argument as hull_of().
  const Hull& hull() const;
  const Fitted& fitted(Fit fit, int most_corners) const;
  /// Throws std::invalid_argument, whose text says what is wrong: no volume, for exact not closed or inside out, for
  /// convex as hull_of().
  Inertia inertia(MeshRule rule) const;

  Mesh surface() const;  ///< the mesh, or its hull where it has no triangles
  bool is_closed() const;
  double volume() const;         ///< of a closed mesh, inside out or not
  double share_of_hull() const;  ///< that volume over the hull's; throws as hull()
  const Eigen::Matrix3Xd& vertices() const { return mesh_.vertices; }
  double size() const;  ///< m, along the longest of its axes

 private:
  Inertia made(MeshRule rule) const;

  Mesh mesh_;
  mutable std::optional<Hull> hull_;
  mutable std::map<std::pair<Fit, int>, Fitted> fits_;
  mutable std::map<MeshRule, Inertia> inertias_;
  mutable std::optional<bool> is_closed_;
  mutable std::optional<double> volume_;
};

}  // namespace lockstep::importer
