// <connect> and <weld>. SPDX-License-Identifier: Apache-2.0
#include "loops.h"

#include <fmt/format.h>

#include <unordered_map>
#include <utility>

#include "couple.h"
#include "model/loops.h"
#include "model/trees.h"
#include "names.h"
#include "pose.h"

namespace lockstep::importer::mjcf {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

class Closer {
 public:
  Closer(const Scene& scene, const Start& start, const std::vector<Place>& places, Draft& draft)
      : scene_(scene), ends_(scene, start, places), draft_(draft), trees_(draft.model) {
    for (const Element& element : scene.closures)
      if (element.has("name")) names_.take(element.name("name"));
  }

  void close(const Element& element) {
    if (scene_.options.loops == Loops::leave_out) {
      report().show_all("closed loops, left out on request");
      return report().warn("closed loops, left out on request", element.place());
    }
    bool holds_frames = element.tag() == "weld";
    auto [first, second] = ends(element, holds_frames);
    if (ends_.is_left_out(first.body) || ends_.is_left_out(second.body))
      return report().warn("loops of bodies left out, left out", element.place());
    if (ends_.place_of(second).link.empty()) std::swap(first, second);
    // A weld to a mocap body holds what the user moves: the body's own frame.
    if (holds_frames && scene_.bodies.all[first.body].is_mocap)
      second.frame = second.frame * first.frame.inverse(), first.frame.setIdentity();
    const Place one = ends_.place_of(first), other = ends_.place_of(second);
    if (!can_move(draft_.model, trees_, one.link, other.link))
      return report().remark("loops of bodies that do not move against each other, without effect", element.place());

    Loop loop;
    loop.name = element.has("name") ? element.name("name") : names_.unused(element.tag());
    loop.kind = holds_frames ? LoopKind::weld : LoopKind::point;
    loop.first = one.link, loop.second = other.link;
    loop.first_pose = one.pose, loop.second_pose = other.pose;
    soften(yielding_of(element, "solref", "solimp"), loop);
    draft_.places["loop '" + loop.name + "'"] = element.place();
    draft_.model.loops.push_back(std::move(loop));
  }

 private:
  Report& report() const { return scene_.report(); }
  const Isometry3d& drawn(std::size_t body) const { return scene_.bodies.all[body].in_world; }

  // `holds_frames` becomes false for a weld that turns freely.
  std::pair<End, End> ends(const Element& element, bool& holds_frames) const {
    if (holds_frames) {
      const double scale = element.number("torquescale", 1.0);
      holds_frames = scale != 0.0;
      if (scale != 0.0 && scale != 1.0)
        report().warn("torque scales of welds, left out", fmt::format("{:g} of {}", scale, element.title()));
    }
    if (element.has("site1") || element.has("site2"))
      return {site(element, element.name("site1")), site(element, element.name("site2"))};
    End first{body(element, element.name("body1"))}, second{body(element, element.name("body2", "world"))};
    if (element.tag() == "connect") {
      if (!element.has("anchor")) element.fail("has neither an anchor nor sites", "write anchor=\"0 0 0\"");
      first.frame = shift(element.triple("anchor", Vector3d::Zero()));
      second.frame = drawn(second.body).inverse() * drawn(first.body) * first.frame;
    } else {
      second.frame = shift(element.triple("anchor", Vector3d::Zero()));
      first.frame = relative_pose(element, first, second);
    }
    return {first, second};
  }

  // Of the second body's frame in the first body. A quaternion of zeros stands for the drawn pose.
  Isometry3d relative_pose(const Element& element, const End& first, const End& second) const {
    double given[7] = {0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    element.numbers("relpose", given, 7, 7);
    const Eigen::Vector4d turn(given[4], given[5], given[6], given[3]);
    if (turn.isZero(0.0)) return drawn(first.body).inverse() * drawn(second.body) * second.frame;
    Isometry3d pose = shift({given[0], given[1], given[2]});
    pose.linear() = Eigen::Quaterniond(Eigen::Vector4d(turn.stableNormalized())).toRotationMatrix();
    return pose;
  }

  std::size_t body(const Element& element, const std::string& name) const {
    const auto found = scene_.body_of.find(name);
    if (found == scene_.body_of.end()) scene_.fail_to_find(element, "body", name);
    return static_cast<std::size_t>(found->second);
  }

  End site(const Element& element, const std::string& name) const {
    const End* const found = ends_.find_site(name);
    if (!found) scene_.fail_to_find(element, "site", name);
    return *found;
  }

  void soften(const Yielding& yielding, Loop& loop) const {
    const bool is_soft = scene_.options.soft == Soft::as_in_file;
    if (const Softness softness = softness_of(yielding); is_soft && !is_hard(softness)) loop.softness = softness;
    report().tally(is_soft ? "loops soft as in MuJoCo, without its virtual mass" : "loops made hard, soft in MuJoCo",
                   words_of(yielding));
  }

  const Scene& scene_;
  const Ends ends_;
  Draft& draft_;
  const Trees trees_;
  Names names_;
};

}  // namespace

void close_loops(const Scene& scene, const Start& start, const std::vector<Place>& places, Draft& draft) {
  if (scene.closures.empty()) return;
  Closer closer(scene, start, places, draft);
  for (const Element& element : scene.closures) scene.report().attempt([&] { closer.close(element); });
}

}  // namespace lockstep::importer::mjcf
