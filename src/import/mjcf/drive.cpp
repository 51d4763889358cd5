// Linear forces along one joint. SPDX-License-Identifier: Apache-2.0
#include "drive.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/by_name.h"
#include "start_inertia.h"

namespace lockstep::importer::mjcf {
namespace {

// What all actuators of a joint come to.
struct Sum {
  double kp = 0.0, kd = 0.0, effort = 0.0;
  double pull = 0.0, drag = 0.0;  // kp times the target, kd times the velocity target
  double limit = 0.0;             // of all, each by itself
  // By tendon with a limit of its own: of its actuators, each by itself, and of the tendon, which is of their sum.
  std::map<int, std::pair<double, double>> limits_of_tendons;
  double lag = 0.0;            // of the first one
  int delay = 0;               // the same, steps
  int count = 0, limited = 0;  // limited: by themselves
  int on_tendons = 0;          // of those with limits
  bool differs = false;        // in lag or delay
};

// "2 u - 0.1"
std::string of_control(double scale, double shift) {
  return fmt::format("{:.10g} u", scale) +
         (shift == 0.0 ? "" : fmt::format(" {} {:.10g}", shift < 0.0 ? '-' : '+', std::abs(shift)));
}

class Driver {
 public:
  Driver(const Scene& scene, const Ties& ties, const std::vector<std::optional<Transmission>>& transmissions,
         const Start& start, Draft& draft)
      : scene_(scene),
        ties_(ties),
        transmissions_(transmissions),
        start_(start),
        model_(draft.model),
        joints_(model_.joints) {}

  std::vector<Control> drive() {
    for (std::size_t a = 0; a < scene_.actuators.size(); ++a) add(scene_.actuators[a], a);
    for (const auto& [index, sum] : sums_) apply(model_.joints[static_cast<std::size_t>(index)], sum);
    return std::move(controls_);
  }

 private:
  Report& report() const { return scene_.report(); }

  void lose(const Actuator& actuator, const std::string& why) const {
    const auto& [constant, stiffness, damping] = actuator.bias;
    std::string force = fmt::format("{:g} u", actuator.gain);
    if (constant != 0.0) force += fmt::format(" + {:g}", constant);
    if (stiffness != 0.0) force += fmt::format(" + {:g} length", stiffness);
    if (damping != 0.0) force += fmt::format(" + {:g} rate", damping);
    if (actuator.gear != 1.0) force += fmt::format(", gear {:g}", actuator.gear);
    for (const auto& [name, range] : {std::pair("force", actuator.force), std::pair("control", actuator.control)})
      if (range) force += fmt::format(", {} {:g} to {:g}", name, range->lower, range->upper);
    report().warn("actuators left out", fmt::format("{} {} ({})", actuator.name, why, force));
    report().show_all("actuators left out");
  }

  // The length along which it acts. Nothing if it has no effect.
  std::optional<Transmission> transmission_of(const Actuator& actuator) const {
    Form length;
    if (actuator.tendon >= 0 && scene_.tendons[static_cast<std::size_t>(actuator.tendon)].is_spatial) {
      const std::optional<Transmission>& own = transmissions_[static_cast<std::size_t>(actuator.tendon)];
      if (!own) lose(actuator, "acts on what no joint moves");
      if (!own || !actuator.has_damping_ratio) return own;
      return lose(actuator, "takes its damping by a ratio on a spatial tendon"), std::nullopt;
    }
    if (actuator.tendon >= 0)
      length = scene_.tendons[static_cast<std::size_t>(actuator.tendon)].length;
    else
      length.add(actuator.joint, 1.0);
    if (ties_.reduced(length).terms.empty()) return lose(actuator, "acts on what no joint moves"), std::nullopt;
    std::erase_if(length.terms, [](const auto& term) { return term.second == 0.0; });
    if (length.terms.size() == 1)  // a follower keeps its own drive
      return Transmission{scene_.joint(length.terms.front().first).name, length.terms.front().second, length.constant};
    for (const auto& [moved, coefficient] : length.terms)
      if (length.terms.size() > 1 && scene_.joint(moved).effort_limit < infinity)
        report().warn(limits_of_tendons_joints, scene_.joint(moved).name);
    return transmissions_[static_cast<std::size_t>(actuator.tendon)];
  }

  double damping(const Actuator& actuator) {
    if (!actuator.has_damping_ratio || !(actuator.gain > 0.0)) return -actuator.bias[2];
    if (inertia_.empty()) inertia_ = locked_inertia(scene_);
    double reflected = 0.0;
    const auto reflect = [&](int index, double coefficient) {
      const double ratio = actuator.gear * coefficient;
      if (ratio * ratio > 1e-15) reflected += inertia_[static_cast<std::size_t>(index)] / (ratio * ratio);
    };
    if (actuator.tendon < 0)
      reflect(actuator.joint, 1.0);
    else
      for (const auto& [index, coefficient] : scene_.tendons[static_cast<std::size_t>(actuator.tendon)].length.terms)
        reflect(index, coefficient);
    const double kv = 2.0 * actuator.damping_ratio * std::sqrt(actuator.gain * reflected);
    report().remark("damping of servos by dampratio, at the inertia of the drawn pose",
                    fmt::format("{} {:.6g}", actuator.name, kv));
    return kv;
  }

  // Force before the gear, along the actuator.
  double force_limit(const Actuator& actuator, bool is_motor) const {
    double limit = infinity;
    if (actuator.force) limit = symmetric(*actuator.force, "forcerange of actuator '" + actuator.name + "'", report());
    if (is_motor && actuator.bias[0] == 0.0 && actuator.control && scene_.settings.clamps_controls)
      limit = std::min(limit, std::abs(actuator.gain) *
                                  std::max(std::abs(actuator.control->lower), std::abs(actuator.control->upper)));
    return limit;
  }

  // In steps of the file, rounded up, and no more than its memory holds, as MuJoCo has it.
  int delay_in_steps(const Actuator& actuator) const {
    constexpr double default_step = 0.002, most = 1000.0, rounding = 1e-6;
    const double step = scene_.settings.time_step > 0.0 ? scene_.settings.time_step : default_step;
    const double steps = std::min(std::ceil(actuator.delay / step - rounding), actuator.samples);
    if (steps > most) {
      report().warn("delays of actuators above 1000 steps, left out",
                    fmt::format("{:g} s of {}", actuator.delay, actuator.name));
      return 0;
    }
    if (actuator.delay > 0.0)
      report().remark("delays of actuators, in steps of the file",
                      fmt::format("{} of {}: {:g} s", steps, actuator.name, actuator.delay));
    return static_cast<int>(steps);
  }

  void add(const Actuator& actuator, std::size_t number) {
    if (!actuator.lost.empty()) return lose(actuator, actuator.lost);
    if (!scene_.settings.has_actuation) return;
    const std::optional<Transmission> transmission = transmission_of(actuator);
    if (!transmission) return;
    const auto& [name, factor, constant, rest] = *transmission;
    const int index = joints_.find(name);
    if (actuator.force && !(actuator.force->lower < 0.0 && actuator.force->upper > 0.0))
      return lose(actuator, "pushes one way only");
    if (actuator.bias[1] > 0.0 || actuator.bias[2] > 0.0) return lose(actuator, "pushes away from its target");
    const double gear = actuator.gear * factor;
    const double offset = actuator.bias[0] + actuator.bias[1] * actuator.gear * constant;
    const double kp = -actuator.bias[1] * gear * gear, kd = damping(actuator) * gear * gear;
    const bool is_motor = kp == 0.0 && kd == 0.0;
    const bool has_control = !start_.control.empty();
    const double force = offset + (has_control ? actuator.gain * control_at(scene_, start_, number) : 0.0);
    Sum& sum = sums_[index];
    sum.kp += kp, sum.kd += kd;
    const int delay = delay_in_steps(actuator);
    if (sum.count == 0) sum.lag = actuator.lag, sum.delay = delay;
    sum.differs |= sum.lag != actuator.lag || sum.delay != delay;
    ++sum.count;
    const Control::Aim aim = is_motor   ? Control::Aim::effort
                             : kp > 0.0 ? Control::Aim::position
                                        : Control::Aim::velocity;
    controls_.push_back({index, aim, gear * actuator.gain, gear * offset, number});
    if (is_motor) {
      sum.effort += gear * force;
      report().remark("efforts by the file's controls u", fmt::format("{} of {}: {}", actuator.name, name,
                                                                      of_control(gear * actuator.gain, gear * offset)));
    } else {
      const double stiffness = kp > 0.0 ? kp : kd;
      if (kp > 0.0)
        sum.pull += has_control ? gear * force : kp * model_.joints[static_cast<std::size_t>(index)].position;
      else
        sum.drag += has_control ? gear * force : 0.0;
      report().remark(kp > 0.0 ? "servos, with position targets by the file's controls u"
                               : "servos, with velocity targets by the file's controls u",
                      fmt::format("{} of {}: {}", actuator.name, name,
                                  of_control(gear * actuator.gain / stiffness, gear * offset / stiffness)));
      if (actuator.control)
        report().tally("ranges of servos' controls, which no step keeps",
                       fmt::format("{:g} to {:g}", actuator.control->lower, actuator.control->upper));
    }
    for (const char* line :
         {"efforts by the file's controls u", "servos, with position targets by the file's controls u",
          "servos, with velocity targets by the file's controls u"})
      report().show_all(line);
    if (actuator.integrates) report().warn("dynamics of actuators, left out", "integrator of " + actuator.name);
    const double limit = force_limit(actuator, is_motor) * std::abs(gear);
    sum.limited += limit < infinity;
    const double of_tendon =
        actuator.tendon < 0 ? infinity : scene_.tendons[static_cast<std::size_t>(actuator.tendon)].effort_limit;
    if (!(of_tendon < infinity)) {
      sum.limit += limit;
      return;
    }
    ++sum.on_tendons;
    auto& [each, all] = sum.limits_of_tendons[actuator.tendon];
    if (each > 0.0 && all != of_tendon * std::abs(gear))
      report().warn("limits of tendons whose actuators have several gears, taken with the largest gear", name);
    each += limit, all = std::max(all, of_tendon * std::abs(gear));  // it is of the forces before the gears
  }

  void apply(Joint& own, const Sum& sum) {
    own.drive.kp = sum.kp, own.drive.kd = sum.kd;
    own.drive.position_target = sum.kp > 0.0 ? sum.pull / sum.kp : 0.0;
    own.drive.velocity_target = sum.kd > 0.0 ? sum.drag / sum.kd : 0.0;
    own.effort = sum.effort;
    double limit = sum.limit;
    for (const auto& [tendon, limits] : sum.limits_of_tendons) limit += std::min(limits.first, limits.second);
    own.effort_limit = std::min(own.effort_limit, limit);
    if (sum.differs)
      report().warn("lags and delays of actuators that share a joint and differ, left out", own.name);
    else
      own.drive.lag = sum.lag, own.drive.delay = sum.delay;
    if (own.drive.lag > 0.0) report().remark("lags of actuators", fmt::format("{:g} s at {}", own.drive.lag, own.name));
    if (sum.count == 1) return;
    report().remark("joints with several actuators, whose gains are added", own.name);
    const bool is_of_one = sum.limits_of_tendons.size() == 1 && sum.on_tendons == sum.count;  // as the file has it
    if (sum.limited > 0 || (sum.on_tendons > 0 && !is_of_one))
      report().warn("limits of single actuators that share a joint, taken for their sum", own.name);
  }

  const Scene& scene_;
  const Ties& ties_;
  const std::vector<std::optional<Transmission>>& transmissions_;
  const Start& start_;
  Model& model_;
  const ByName joints_;
  std::map<int, Sum> sums_;  // by joint of the model
  std::vector<Control> controls_;
  std::vector<double> inertia_;
};

}  // namespace

std::vector<Control> drive_joints(const Scene& scene, const Ties& ties,
                                  const std::vector<std::optional<Transmission>>& transmissions, const Start& start,
                                  Draft& draft) {
  return Driver(scene, ties, transmissions, start, draft).drive();
}

double control_at(const Scene& scene, const Start& start, std::size_t actuator) {
  const double u = start.control[actuator];
  const std::optional<Range>& range = scene.actuators[actuator].control;
  return range && scene.settings.clamps_controls ? std::clamp(u, range->lower, range->upper) : u;
}

}  // namespace lockstep::importer::mjcf
