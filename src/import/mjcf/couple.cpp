// Hard and soft couplings, and joints that stand still. SPDX-License-Identifier: Apache-2.0
#include "couple.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "model/by_name.h"
#include "model/functions.h"

namespace lockstep::importer::mjcf {
namespace {

class Coupler {
 public:
  Coupler(const Scene& scene, Draft& draft)
      : scene_(scene), draft_(draft), joints_(draft.model.joints), rows_(scene.equalities), curves_(scene.curves) {
    for (const Coupling& coupling : draft.model.couplings) ++couplings_[coupling.joint];
  }

  Ties couple() {
    while (lock_one() || straighten_one()) {
    }
    for (const Equality& row : rows_) add(row);
    for (const Curve& curve : curves_) add(curve);
    start_followers();
    return std::move(ties_);
  }

 private:
  Joint& joint(int index) {
    return draft_.model.joints[static_cast<std::size_t>(joints_.find(scene_.joint(index).name))];
  }

  // Without joints that stand still and terms without effect.
  void simplify(Form& form) const {
    Form left;
    left.constant = form.constant;
    for (const auto& [index, coefficient] : form.terms) {
      const auto still = still_.find(index);
      if (still != still_.end())
        left.constant += coefficient * still->second;
      else if (coefficient != 0.0)
        left.add(index, coefficient);
    }
    form = left;
  }

  bool lock_one() {
    for (auto row = rows_.begin(); row != rows_.end(); ++row) {
      simplify(row->form);
      if (row->form.terms.size() > 1) continue;
      const Equality held = *row;
      rows_.erase(row);
      if (held.form.terms.empty()) {
        if (std::abs(held.form.constant) > 1e-9) contradict(held);
        scene_.report().remark("equalities that hold anyway", held.place);
        return true;
      }
      const auto& [index, coefficient] = held.form.terms.front();
      stop(index, -held.form.constant / coefficient);
      ties_.add(held.form);
      return true;
    }
    return false;
  }

  // What follows a joint that stands still does, too.
  bool straighten_one() {
    const auto curve = std::find_if(curves_.begin(), curves_.end(),
                                    [&](const Curve& candidate) { return still_.contains(candidate.leader); });
    if (curve == curves_.end()) return false;
    Equality row{curve->place, curve->place, {}, curve->yielding};
    row.form.add(curve->follower, 1.0);
    row.form.constant = -curve_at(curve->polynomial, still_.at(curve->leader)).value;
    rows_.push_back(row);
    curves_.erase(curve);
    return true;
  }

  void stop(int index, double position) {
    still_[index] = position;
    Joint& own = joint(index);
    Joint fixed;
    fixed.name = own.name, fixed.parent = own.parent, fixed.child = own.child;
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    if (own.kind == JointKind::prismatic)
      motion.translation() = position * own.axis;
    else
      motion.linear() = Eigen::AngleAxisd(position, own.axis).toRotationMatrix();
    fixed.origin = own.origin * motion;
    own = fixed;
    scene_.report().remark("joints that an equality holds alone, made fixed",
                           fmt::format("{} at {:.6g}", own.name, position));
  }

  [[noreturn]] static void contradict(const Equality& row) {
    throw ImportError(row.place, "contradicts the equalities before it", "correct or remove one of them");
  }

  Softness softness_for(const Yielding& yielding) const {
    const bool is_soft = scene_.options.soft == Soft::as_in_file;
    scene_.report().tally(
        is_soft ? "couplings soft as in MuJoCo, without its virtual mass" : "couplings made hard, soft in MuJoCo",
        words_of(yielding));
    return is_soft ? softness_of(yielding) : Softness(Hard{});
  }

  void add(Coupling coupling, const std::string& place) {
    draft_.places[fmt::format("coupling '{}'", coupling_name(coupling.joint, ++couplings_[coupling.joint]))] = place;
    draft_.model.couplings.push_back(std::move(coupling));
  }

  void add(const Equality& row) {
    const Softness softness = softness_for(row.yielding);
    if (is_hard(softness)) {
      const Ties::Added added = ties_.add(row.form);
      if (added == Ties::Added::contradiction) contradict(row);
      if (added == Ties::Added::redundant) scene_.report().remark("equalities that follow from others", row.place);
    }
    add(coupling_of(row.form, scene_, softness), row.place);
  }

  void add(const Curve& curve) {
    if (still_.contains(curve.follower))
      throw ImportError(curve.place,
                        fmt::format("makes joint '{}', which stands still, a function of joint '{}'",
                                    scene_.joint(curve.follower).name, scene_.joint(curve.leader).name),
                        "hold the leader instead: the function then holds the follower");
    scene_.report().tally("followers by a function made hard, soft in MuJoCo", words_of(curve.yielding));
    add(Coupling::cam(scene_.joint(curve.follower).name, scene_.joint(curve.leader).name, curve.polynomial),
        curve.place);
  }

  // Leaders of the one kind may be followers of the other.
  void start_followers() {
    std::map<int, double> before;
    place_tied(before);
    for (std::size_t pass = 0; pass < curves_.size(); ++pass) {
      for (const Curve& curve : curves_) place_on(curve, before);
      place_tied(before);
    }
    for (const auto& [index, position] : before) {
      const Joint& own = joint(index);
      if (std::abs(own.position - position) > 1e-9)
        scene_.report().remark("followers that start where their coupling puts them",
                               fmt::format("{} at {:.6g}", own.name, own.position));
    }
  }

  void place_tied(std::map<int, double>& before) {
    const auto value = [&](const Form& form, double Joint::*number, double constant) {
      for (const auto& [leader, factor] : form.terms) constant += factor * (joint(leader).*number);
      return constant;
    };
    for (const auto& [index, form] : ties_.tied())
      if (!still_.contains(index))
        place(index, value(form, &Joint::position, form.constant), value(form, &Joint::velocity, 0.0), before);
  }

  void place_on(const Curve& curve, std::map<int, double>& before) {
    const Joint& leader = joint(curve.leader);
    const simd::Curve<double> at = curve_at(curve.polynomial, leader.position);
    place(curve.follower, at.value, at.slope * leader.velocity, before);
  }

  void place(int index, double position, double velocity, std::map<int, double>& before) {
    Joint& own = joint(index);
    before.emplace(index, own.position);
    own.position = position;
    own.velocity = velocity;
  }

  const Scene& scene_;
  Draft& draft_;
  const ByName joints_;
  std::map<std::string, int> couplings_;  // by follower
  std::vector<Equality> rows_;
  std::vector<Curve> curves_;
  std::map<int, double> still_;  // positions by joint
  Ties ties_;
};

}  // namespace

Ties couple(const Scene& scene, Draft& draft) { return Coupler(scene, draft).couple(); }

// MuJoCo's acceleration of the error r is (1 - d) a_free - 2 r' / t - r / (t z)^2 where the impedance is d: this spring
// and a virtual mass.
Softness softness_of(const Yielding& yielding) {
  const double rest = 1.0 - std::clamp(yielding.solimp[1], 0.0001, 0.9999);
  const auto [first, second] = yielding.solref;
  if (first > 0.0) return Frequency{1.0 / (first * std::max(second, 1e-6) * std::sqrt(rest)), second / std::sqrt(rest)};
  const double stiffness = std::max(-first, 0.0), damping = std::max(-second, 0.0);
  if (!(stiffness > 0.0)) return Hard{};
  return Frequency{std::sqrt(stiffness / rest), damping / (2.0 * std::sqrt(stiffness * rest))};
}

Coupling coupling_of(const Form& form, const Scene& scene, const Softness& softness) {
  const double first = form.terms.front().second;
  Coupling coupling{scene.joint(form.terms.front().first).name, {}, 0.0 + form.constant / first, softness};
  for (std::size_t t = 1; t < form.terms.size(); ++t)
    coupling.terms.push_back({scene.joint(form.terms[t].first).name, form.terms[t].second / first});
  return coupling;
}

}  // namespace lockstep::importer::mjcf
