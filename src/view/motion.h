// Samples of a motion: what the page shows. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "solids.h"

namespace lockstep::view {

/// The readbacks of one environment, sample after sample.
struct Track {
  struct Frozen {
    double time;  ///< s
    Fault fault;
    std::optional<double> until = {};  ///< s: the first sample after a reset
  };
  std::string label;
  std::vector<Frozen> frozen;  ///< one after the other
  std::vector<float> poses;    ///< [samples][drawn links][7], as Quantity::link_pose
  std::vector<float> pushes;   ///< [samples][pairs of colliders][6]: centre of its points (m), force on the second (N)
  /// [samples] each: positions by dof, errors by coupling, normal forces by pair of colliders, kinetic and potential
  /// energy.
  std::vector<std::vector<float>> curves;
};

struct Motion {
  /// Without samples yet. Links that have `meshes` are drawn as these.
  Motion(const Plan& plan, bool has_forces, std::vector<std::string> labels,
         const std::vector<VisualMesh>& meshes = {});

  Plan plan;
  bool has_forces;  ///< false: nothing is read of contacts
  std::vector<DrawnLink> links;
  std::vector<float> times;  ///< s
  std::vector<Track> tracks;

  /// Throws UsageError where so many samples would be too much for a page.
  void require_room(std::size_t samples) const;

  /// Adds a sample: track i is environment `environments[i]` of the batch, whose plan is this one.
  template <class S>
  void add(double time, const Batch<S>& batch, const std::vector<int>& environments);

  /// Takes all samples away.
  void clear();

  /// Adds all the states of a recording, which are the environments of a batch, to one track.
  void add(const std::vector<double>& times, const Batch<double>& states, int track);

 private:
  template <class S>
  typename Batch<S>::Array read(const Batch<S>& batch) const;
  template <class Column>
  void append(const Column& numbers, Track& track) const;
  std::vector<Query> queries_;  // poses, contact points, then what curves are made of
  std::size_t pose_rows_ = 0, point_rows_ = 0, curves_ = 0;
};

/// Steps from one sample to the next, so that there are about `rate` samples a second.
long sampling_interval(double rate, double dt);

}  // namespace lockstep::view
