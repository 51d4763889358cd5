// Frames on bodies, of loops and of spatial tendons. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <unordered_map>
#include <vector>

#include "trees.h"

namespace lockstep::importer::mjcf {

/// A frame on a body.
struct End {
  std::size_t body;
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
};

class Ends {
 public:
  Ends(const Scene& scene, const Start& start, const std::vector<Place>& places)
      : scene_(scene), start_(start), places_(places) {
    for (std::size_t b = 0; b < scene.bodies.all.size(); ++b)
      for (const SitePart& part : scene.bodies.all[b].sites) sites_.emplace(part.name, End{b, part.pose});
  }

  /// Null if no site has that name.
  const End* find_site(const std::string& name) const {
    const auto found = sites_.find(name);
    return found == sites_.end() ? nullptr : &found->second;
  }

  /// Whether ImportOptions::body leaves the body out, and it moves.
  bool is_left_out(std::size_t body) const { return scene_.bodies.moves[body] && !scene_.is_read[body]; }

  /// Where the frame is in the model.
  Place place_of(const End& end) const {
    const auto b = static_cast<int>(end.body);
    const Body& body = scene_.bodies.all[end.body];
    if (body.is_mocap) return {"", start_.pose.at(b) * end.frame};
    if (b == 0 || !scene_.is_read[end.body]) return {"", body.in_world * end.frame};
    return {places_[end.body].link, places_[end.body].pose * end.frame};
  }

 private:
  const Scene& scene_;
  const Start& start_;
  const std::vector<Place>& places_;
  std::unordered_map<std::string, End> sites_;  // by name
};

}  // namespace lockstep::importer::mjcf
