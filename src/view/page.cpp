// SPDX-License-Identifier: Apache-2.0
#include "page.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>

#include "lockstep/error.h"
#include "unit.h"

namespace lockstep::view {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t most_named = 3;  // links in a line of the page
constexpr std::string_view place_of_motion = "/*MOTION*/";

// In a Pose's order: x, y, z, then the quaternion w, x, y, z.
Json json_of(const Pose& pose) {
  const Eigen::Quaterniond turn(pose.linear());
  const Eigen::Vector3d at = pose.translation();
  return {at.x(), at.y(), at.z(), turn.w(), turn.x(), turn.y(), turn.z()};
}

Json json_of(const std::vector<Solid>& solids) {
  Json list = Json::array();
  for (const Solid& solid : solids) {
    const auto& [kind, size, points, heights] = solid.shape;
    Json entry = {{"kind", to_string(kind)}, {"size", {size.x(), size.y(), size.z()}}, {"pose", json_of(solid.pose)}};
    for (Eigen::Index i = 0; i < points.cols(); ++i)
      entry["points"].push_back({points(0, i), points(1, i), points(2, i)});
    for (Eigen::Index row = 0; row < heights.rows(); ++row) {
      const Eigen::RowVectorXd numbers = heights.row(row);
      entry["heights"].push_back(std::vector<double>(numbers.begin(), numbers.end()));
    }
    if (solid.from_inertia) entry["inertia"] = true;
    list.push_back(std::move(entry));
  }
  return list;
}

template <class Numbers>
std::string bytes_of(const Numbers& numbers) {
  static_assert(std::endian::native == std::endian::little, "the page is read as it is written");
  static_assert(sizeof(typename Numbers::value_type) == 4);
  return base64({reinterpret_cast<const unsigned char*>(numbers.data()), static_cast<std::size_t>(numbers.size()) * 4});
}

Json json_of(const std::vector<VisualMesh>& meshes) {
  Json list = Json::array();
  for (const VisualMesh& mesh : meshes)
    list.push_back({{"vertices", bytes_of(mesh.vertices.reshaped().eval())},
                    {"triangles", bytes_of(mesh.triangles.reshaped().eval())}});
  return list;
}

// A follower has `leader`, the joint that it follows; -1 where that is not one joint.
Json joints_of(const Plan& plan) {
  Json list = Json::array();
  for (const std::string& name : plan.dof_names())
    list.push_back({{"name", name}, {"unit", unit_of(plan.model(), name)}});
  for (const int dof : plan.follower_dofs()) list[static_cast<std::size_t>(dof)]["leader"] = plan.leader(dof);
  return list;
}

Json couplings_of(const Model& model) {
  Json list = Json::array();
  const std::vector<std::string> names = coupling_names(model);
  for (std::size_t i = 0; i < names.size(); ++i)
    list.push_back({{"name", names[i]}, {"unit", unit_of(model, model.couplings[i].joint)}});
  return list;
}

}  // namespace

void require_viewer() {
  if (page_template.empty())
    throw UsageError("viewer", "is not part of this build",
                     "install nodejs and npm (Debian's names), and build it again with -DLOCKSTEP_VIEWER=ON");
}

std::string motion_numbers(const Motion& motion) {
  std::vector<float> numbers = motion.times;
  for (const Track& track : motion.tracks) {
    numbers.insert(numbers.end(), track.poses.begin(), track.poses.end());
    numbers.insert(numbers.end(), track.pushes.begin(), track.pushes.end());
    for (const std::vector<float>& curve : track.curves) numbers.insert(numbers.end(), curve.begin(), curve.end());
  }
  return bytes_of(numbers);
}

std::string motion_json(const Motion& motion, const std::string& about, const std::vector<std::string>& notes) {
  const Model& model = motion.plan.model();
  Json json = {{"model", model.name}, {"about", about}, {"notes", notes}, {"samples", motion.times.size()}};
  json["floats"] = motion.plan.root_names().size() == motion.plan.trees().size();  // all trees do
  json["links"] = Json::array();
  for (const DrawnLink& drawn : motion.links)
    json["links"].push_back({{"name", model.links[static_cast<std::size_t>(drawn.link)].name},
                             {"role", to_string(drawn.role)},
                             {"meshes", json_of(drawn.meshes)},
                             {"solids", json_of(drawn.solids)}});
  json["world"] = json_of(world_solids(model));
  json["joints"] = joints_of(motion.plan);
  json["couplings"] = couplings_of(model);
  json["contacts"] = Json::array();
  if (motion.has_forces)
    for (const PlanContact& contact : motion.plan.contacts()) json["contacts"].push_back(contact.name);
  json["environments"] = Json::array();
  for (const Track& track : motion.tracks) {
    Json entry = {{"label", track.label}};
    entry["faults"] = Json::array();
    for (const Track::Frozen& frozen : track.frozen) {
      entry["faults"].push_back({{"time", frozen.time}, {"name", to_string(frozen.fault)}});
      if (frozen.until) entry["faults"].back()["until"] = *frozen.until;
    }
    json["environments"].push_back(std::move(entry));
  }
  json["numbers"] = motion_numbers(motion);
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  // Only texts can hold this character, which could end the script element.
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at))
    text.replace(at, 1, "\\u003c");
  return text;
}

std::vector<std::string> notes_on(const Motion& motion) {
  std::vector<std::string> notes, without;
  std::vector<bool> drawn(motion.plan.model().links.size(), false);
  for (const DrawnLink& link : motion.links) drawn[static_cast<std::size_t>(link.link)] = true;
  for (std::size_t i = 0; i < drawn.size(); ++i)
    if (!drawn[i]) without.push_back(motion.plan.model().links[i].name);
  if (!without.empty()) {
    const std::size_t named = std::min(without.size(), most_named);
    notes.push_back(
        fmt::format("neither collider nor mass: {}", fmt::join(without.begin(), without.begin() + named, ", ")));
    if (without.size() > named) notes.back() += fmt::format(" and {} more links", without.size() - named);
  }
  if (!motion.has_forces && !motion.plan.contacts().empty()) notes.push_back("recordings hold no contact forces");
  return notes;
}

std::string page_of(const Motion& motion, const std::string& about, const std::vector<std::string>& notes) {
  std::string page(page_template);
  return page.replace(page.find(place_of_motion), place_of_motion.size(), motion_json(motion, about, notes));
}

std::string base64(std::span<const unsigned char> bytes) {
  constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    unsigned triple = 0;
    for (std::size_t i = 0; i < 3; ++i) triple = triple << 8 | (i < count ? bytes[at + i] : 0u);
    for (std::size_t i = 0; i < 4; ++i) text += i <= count ? digits[triple >> (18 - 6 * i) & 63] : '=';
  }
  return text;
}

}  // namespace lockstep::view
