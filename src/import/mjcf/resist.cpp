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

// One tendon.
class Resistance {
 public:
  Resistance(const Tendon& tendon, const Scene& scene, const Ties& ties,
             const std::optional<Transmission>& transmission, Draft& draft)
      : tendon_(tendon),
        scene_(scene),
        ties_(ties),
        transmission_(transmission),
        draft_(draft),
        name_(title_of(tendon)) {}

  // `what` names all of it.
  void add(const std::string& what) {
    const Form free = ties_.reduced(tendon_.length);
    if (tendon_.is_spatial ? !transmission_ : free.terms.empty())
      return report().remark("tendons whose length no joint changes, without effect", what);
    if (!transmission_) return add_coupling(free);
    Joint& own = draft_.model.joints[static_cast<std::size_t>(draft_.model.joint_index(transmission_->joint))];
    const auto& [joint, factor, constant, rest_of_path] = *transmission_;
    if (tendon_.range) limit(own);
    if (!tendon_.has_slack()) add_spring(own, tendon_.stiffness * factor * factor, (rest() - constant) / factor);
    own.damping += tendon_.damping * factor * factor;
    own.friction += tendon_.friction * std::abs(factor);
    if (!tendon_.is_spatial) own.armature += tendon_.armature * factor * factor;
    if (own.kind == JointKind::tendon) return;
    if (tendon_.range)
      report().remark("limits of tendons, on the joint that moves them", fmt::format("{} on {}", name_, joint));
    if ((tendon_.stiffness != 0.0 && !tendon_.has_slack()) || tendon_.damping != 0.0)
      report().remark("springs of tendons, on the joint that moves them", fmt::format("{} on {}", name_, joint));
  }

 private:
  Report& report() const { return scene_.report(); }

  void limit(Joint& own) const {
    const double one = (tendon_.range->lower - transmission_->constant) / transmission_->factor;
    const double other = (tendon_.range->upper - transmission_->constant) / transmission_->factor;
    own.lower = std::max(own.lower, std::min(one, other));
    own.upper = std::min(own.upper, std::max(one, other));
    if (own.kind == JointKind::continuous) own.kind = JointKind::revolute;
  }

  // The length at which the spring has no force.
  double rest() const {
    if (tendon_.shortest != -1.0 || tendon_.longest != -1.0) return tendon_.shortest;
    if (tendon_.is_spatial) return transmission_->rest;
    double length = 0.0;
    for (const auto& [index, coefficient] : tendon_.length.terms) length += coefficient * scene_.joint(index).rest;
    return length;
  }

  void add_coupling(Form error) {
    if (tendon_.stiffness == 0.0 && tendon_.damping == 0.0) return;
    error.constant -= rest();
    const double first = error.terms.front().second;
    draft_.model.couplings.push_back(
        coupling_of(error, scene_, Spring{tendon_.stiffness * first * first, tendon_.damping * first * first}));
    draft_.places[fmt::format("coupling '{}'", coupling_names(draft_.model).back())] = tendon_.place;
    report().remark("springs of tendons, as soft couplings", name_);
  }

  const Tendon& tendon_;
  const Scene& scene_;
  const Ties& ties_;
  const std::optional<Transmission>& transmission_;
  Draft& draft_;
  const std::string name_;
};

}  // namespace

void resist_tendons(const Scene& scene, const Ties& ties, const std::vector<std::optional<Transmission>>& transmissions,
                    Draft& draft) {
  for (std::size_t t = 0; t < scene.tendons.size(); ++t) {
    const Tendon& tendon = scene.tendons[t];
    std::string numbers;
    const auto add = [&](const char* what, double value) {
      if (value != 0.0) numbers += fmt::format("{}{} {:g}", numbers.empty() ? "" : ", ", what, value);
    };
    add("stiffness", tendon.stiffness), add("damping", tendon.damping);
    add("friction", tendon.friction), add("armature", tendon.armature);
    if (tendon.range)
      numbers += fmt::format("{}{:g} to {:g}", numbers.empty() ? "" : ", ", tendon.range->lower, tendon.range->upper);
    if (numbers.empty()) continue;
    const std::string what = fmt::format("{} ({})", title_of(tendon), numbers);
    if (!tendon.is_whole)
      scene.report().warn("tendons over bodies left out, left out", what);
    else
      Resistance(tendon, scene, ties, transmissions[t], draft).add(what);
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
    double own = inertia[j];
    if (!part.ball.empty()) {  // one for all its axes
      double inverse = 0.0;
      for (std::size_t k = 0; k < 3; ++k) inverse += 1.0 / inertia[j - static_cast<std::size_t>(part.part()) + k];
      own = 3.0 / inverse;
    }
    if (!(own > 0.0) || own == infinity)
      throw ImportError(part.place, "has a springdamper, but moves no inertia", "give stiffness and damping instead");
    Joint& joint = draft.model.joints[static_cast<std::size_t>(draft.model.joint_index(part.name))];
    if (!joint.moves()) continue;
    const double period = part.time_constant * part.damping_ratio;
    joint.stiffness = scene.settings.has_springs ? own / (period * period) : 0.0;
    joint.damping = scene.settings.has_damping ? 2.0 * own / part.time_constant : 0.0;
    scene.report().remark("springs by springdamper, at the inertia of the drawn pose",
                          fmt::format("{} {:.6g}, damping {:.6g}", joint.name, joint.stiffness, joint.damping));
  }
}

}  // namespace lockstep::importer::mjcf
