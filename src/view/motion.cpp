// SPDX-License-Identifier: Apache-2.0
#include "motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lockstep/error.h"

namespace lockstep::view {
namespace {

constexpr double most_numbers = 5e7;       // 270 MB of text, which browsers still read
constexpr std::size_t rows_of_point = 11;  // of Quantity::contact_point

// The points of a pair as one: their mean, weighted with their forces, and the sum of these. Zero where none bears any.
Eigen::Matrix<float, 6, 1> push_of(const float* points, int slots) {
  Eigen::Vector3f centre = Eigen::Vector3f::Zero(), force = Eigen::Vector3f::Zero();
  float weights = 0.0f;
  for (int slot = 0; slot < slots; ++slot, points += rows_of_point) {
    const Eigen::Map<const Eigen::Vector3f> at(points), on_second(points + 6);
    if (on_second.isZero(0.0f)) continue;  // where no point is, the rest says nothing
    centre += on_second.norm() * at;
    force += on_second;
    weights += on_second.norm();
  }
  Eigen::Matrix<float, 6, 1> push = Eigen::Matrix<float, 6, 1>::Zero();
  if (weights > 0.0f) push << centre / weights, force;
  return push;
}

}  // namespace

Motion::Motion(const Plan& the_plan, bool with_forces, std::vector<std::string> labels,
               const std::vector<VisualMesh>& meshes)
    : plan(the_plan), has_forces(with_forces && !the_plan.contacts().empty()), links(drawn_links(the_plan, meshes)) {
  const auto ask = [this](Query query) {
    queries_.push_back(std::move(query));
    return static_cast<std::size_t>(plan.query_rows(queries_.back()));
  };
  if (!links.empty()) {  // no elements would be all
    Query poses{Quantity::link_pose};
    for (const DrawnLink& drawn : links) poses.elements.push_back(drawn.link);
    pose_rows_ = ask(std::move(poses));
  }
  if (has_forces) point_rows_ = ask({Quantity::contact_point});
  curves_ = ask({Quantity::position}) + ask({Quantity::coupling_error});
  if (has_forces) curves_ += ask({Quantity::contact_normal_force});
  curves_ += ask({Quantity::kinetic_energy}) + ask({Quantity::potential_energy});
  for (std::string& label : labels) {
    tracks.emplace_back().label = std::move(label);
    tracks.back().curves.resize(curves_);
  }
}

void Motion::require_room(std::size_t samples) const {
  const std::size_t pushes = has_forces ? 6 * plan.contacts().size() : 0;
  const double numbers =
      static_cast<double>(pose_rows_ + pushes + curves_) * static_cast<double>(samples * tracks.size());
  if (numbers > most_numbers)
    throw UsageError(
        "page", fmt::format("of {:.3g} numbers is too large for a browser, which takes {:.3g}", numbers, most_numbers),
        "show fewer samples a second, fewer environments or a shorter motion");
}

template <class S>
typename Batch<S>::Array Motion::read(const Batch<S>& batch) const {
  typename Batch<S>::Array numbers(pose_rows_ + point_rows_ + curves_, batch.environments());
  batch.read(queries_, {numbers.data(), batch.environments(), 1});
  return numbers;
}

template <class Column>
void Motion::append(const Column& numbers, Track& track) const {
  const Eigen::ArrayXf all = numbers.template cast<float>();
  track.poses.insert(track.poses.end(), all.begin(), all.begin() + static_cast<Eigen::Index>(pose_rows_));
  if (has_forces)
    for (const PlanContact& contact : plan.contacts()) {
      const Eigen::Matrix<float, 6, 1> push = push_of(
          all.data() + pose_rows_ + rows_of_point * static_cast<std::size_t>(contact.first_slot), contact.slots);
      track.pushes.insert(track.pushes.end(), push.begin(), push.end());
    }
  for (std::size_t i = 0; i < curves_; ++i)
    track.curves[i].push_back(all[static_cast<Eigen::Index>(pose_rows_ + point_rows_ + i)]);
}

template <class S>
void Motion::add(double time, const Batch<S>& batch, const std::vector<int>& environments) {
  const typename Batch<S>::Array numbers = read(batch);
  times.push_back(static_cast<float>(time));
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    append(numbers.col(environments[i]), tracks[i]);
    const FaultReport report = batch.fault_report(environments[i]);
    std::vector<Track::Frozen>& frozen = tracks[i].frozen;
    const bool was_frozen = !frozen.empty() && !frozen.back().until;
    if (report.fault == Fault::none) {
      if (was_frozen) frozen.back().until = time;
    } else if (!was_frozen) {  // its time is that since a reset, which may be another
      const double before = times.size() > 1 ? times[times.size() - 2] : time;
      frozen.push_back({std::clamp(report.time, before, time), report.fault});
    }
  }
}

void Motion::add(const std::vector<double>& at, const Batch<double>& states, int track) {
  const Batch<double>::Array numbers = read(states);
  times.assign(at.begin(), at.end());
  for (Eigen::Index sample = 0; sample < numbers.cols(); ++sample) append(numbers.col(sample), tracks[track]);
}

void Motion::clear() {
  times.clear();
  for (Track& track : tracks) {
    track.frozen.clear();
    track.poses.clear();
    track.pushes.clear();
    for (std::vector<float>& curve : track.curves) curve.clear();
  }
}

long sampling_interval(double rate, double dt) { return std::max(1L, std::lround(1.0 / (rate * dt))); }

template void Motion::add(double, const Batch<float>&, const std::vector<int>&);
template void Motion::add(double, const Batch<double>&, const std::vector<int>&);

}  // namespace lockstep::view
