// Forces of tendons on one joint or several. SPDX-License-Identifier: Apache-2.0
#include "resist.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "couple.h"
#include "lockstep/error.h"
#include "start_inertia.h"

namespace lockstep::importer::mjcf {
namespace {

void add_spring(Joint& joint, double stiffness, double rest) {
  const double sum = joint.stiffness + stiffness;
  if (!(sum > 0.0)) return;
  joint.rest = (joint.stiffness * joint.rest + stiffness * rest) / sum;
  joint.stiffness = sum;
}

// One fixed tendon.
class Resistance {
 public:
  Resistance(const Tendon& tendon, const Scene& scene, const Ties& ties, Draft& draft)
      : tendon_(tendon),
        scene_(scene),
        draft_(draft),
        free_(ties.reduced(tendon.length)),
        name_(tendon.name.empty() ? tendon.place : tendon.name) {}

  void add() {
    limit();
    spring();
    const auto loss = [&](const char* what, double value, auto use) {
      if (value == 0.0) return;
      if (free_.terms.size() == 1)
        use(joint(), factor());
      else
        lose(what, fmt::format("{:g}{}", value, free_.terms.empty() ? ", an equality holds it" : ""));
    };
    loss("friction of tendons, left out", tendon_.friction,
         [&](Joint& own, double c) { own.friction += tendon_.friction * std::abs(c); });
    loss("armature of tendons, left out", tendon_.armature,
         [&](Joint& own, double c) { own.armature += tendon_.armature * c * c; });
  }

 private:
  Report& report() const { return scene_.report(); }
  // Of the one joint that all are tied to.
  Joint& joint() {
    Model& model = draft_.model;
    return model.joints[static_cast<std::size_t>(model.joint_index(scene_.joint(free_.terms.front().first).name))];
  }
  double factor() const { return free_.terms.front().second; }

  void lose(const char* what, const std::string& numbers) const {
    report().warn(what, fmt::format("{} ({})", name_, numbers));
  }
  bool is_held(const char* what) const {
    if (free_.terms.empty())
      report().remark("tendons that an equality holds, without effect", fmt::format("{} of {}", what, name_));
    return free_.terms.empty();
  }

  void limit() {
    if (!tendon_.range || is_held("range")) return;
    if (free_.terms.size() > 1)
      return lose("limits of tendons over several joints, left out",
                  fmt::format("{:g} to {:g}", tendon_.range->lower, tendon_.range->upper));
    Joint& own = joint();
    const double one = (tendon_.range->lower - free_.constant) / factor();
    const double other = (tendon_.range->upper - free_.constant) / factor();
    own.lower = std::max(own.lower, std::min(one, other));
    own.upper = std::min(own.upper, std::max(one, other));
    if (own.kind == JointKind::continuous) own.kind = JointKind::revolute;
    report().remark("limits of tendons, on the joint that moves them", fmt::format("{} on {}", name_, own.name));
  }

  double length_at_springref() const {
    double length = 0.0;
    for (const auto& [index, coefficient] : tendon_.length.terms) length += coefficient * scene_.joint(index).rest;
    return length;
  }

  void spring() {
    double stiffness = tendon_.stiffness;
    const double damping = tendon_.damping;
    if ((stiffness == 0.0 && damping == 0.0) || is_held("spring")) return;
    const bool is_automatic = tendon_.shortest == -1.0;
    if (stiffness != 0.0 && !is_automatic && tendon_.shortest != tendon_.longest) {
      lose("springs of tendons with a range without force, left out",
           fmt::format("{:g} beyond {:g} to {:g}", stiffness, tendon_.shortest, tendon_.longest));
      stiffness = 0.0;
      if (damping == 0.0) return;
    }
    const double rest = is_automatic ? length_at_springref() : tendon_.shortest;
    if (free_.terms.size() == 1) {
      Joint& own = joint();
      add_spring(own, stiffness * factor() * factor(), (rest - free_.constant) / factor());
      own.damping += damping * factor() * factor();
      return report().remark("springs of tendons, on the joint that moves them",
                             fmt::format("{} on {}", name_, own.name));
    }
    Form error = free_;
    error.constant -= rest;
    const double first = error.terms.front().second;
    draft_.model.couplings.push_back(
        coupling_of(error, scene_, Spring{stiffness * first * first, damping * first * first}));
    draft_.places[fmt::format("coupling '{}'", coupling_names(draft_.model).back())] = tendon_.place;
    report().remark("springs of tendons, as soft couplings", name_);
  }

  const Tendon& tendon_;
  const Scene& scene_;
  Draft& draft_;
  const Form free_;  // its length in independent joints
  const std::string name_;
};

}  // namespace

void resist_tendons(const Scene& scene, const Ties& ties, Draft& draft) {
  for (const Tendon& tendon : scene.tendons) {
    std::string numbers;
    const auto add = [&](const char* what, double value) {
      if (value != 0.0) numbers += fmt::format("{}{} {:g}", numbers.empty() ? "" : ", ", what, value);
    };
    add("stiffness", tendon.stiffness), add("damping", tendon.damping);
    add("friction", tendon.friction), add("armature", tendon.armature);
    if (tendon.range)
      numbers += fmt::format("{}{:g} to {:g}", numbers.empty() ? "" : ", ", tendon.range->lower, tendon.range->upper);
    if (numbers.empty()) continue;
    const std::string what = fmt::format("{} ({})", tendon.name.empty() ? tendon.place : tendon.name, numbers);
    if (tendon.is_spatial)
      scene.report().warn("spatial tendons that limit, pull or resist, left out", what);
    else if (!tendon.is_whole)
      scene.report().warn("tendons over bodies left out, left out", what);
    else
      Resistance(tendon, scene, ties, draft).add();
  }
}

void resist_by_time_constants(const Scene& scene, Draft& draft) {
  std::vector<double> inertia;
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const JointPart& part = scene.joint(static_cast<int>(j));
    if (!(part.time_constant > 0.0) || !scene.is_joint_read(static_cast<int>(j))) continue;
    if (scene.joints.size() > 2000)
      throw ImportError(part.place, "has a springdamper, among more than 2000 joints",
                        "give stiffness and damping instead");
    if (inertia.empty()) inertia = free_inertia(scene);
    if (!(inertia[j] > 0.0) || inertia[j] == infinity)
      throw ImportError(part.place, "has a springdamper, but moves no inertia", "give stiffness and damping instead");
    Joint& joint = draft.model.joints[static_cast<std::size_t>(draft.model.joint_index(part.name))];
    if (!joint.moves()) continue;
    const double period = part.time_constant * part.damping_ratio;
    joint.stiffness = inertia[j] / (period * period);
    joint.damping = 2.0 * inertia[j] / part.time_constant;
    scene.report().remark("springs by springdamper, at the inertia of the drawn pose",
                          fmt::format("{} {:.6g}, damping {:.6g}", joint.name, joint.stiffness, joint.damping));
  }
}

}  // namespace lockstep::importer::mjcf
