// Batch::Impl: storage, stepping over tiles. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "blob.h"
#include "checked_options.h"
#include "draws.h"
#include "engine.h"
#include "extent.h"
#include "in_use.h"
#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "model/poses.h"
#include "placer.h"
#include "plan/fields.h"
#include "plan/program.h"
#include "targets/dispatch.h"
#include "targets/registry.h"
#include "turned.h"
#include "values.h"
#include "workers.h"

namespace lockstep {

/// w, x, y, z
template <class S>
Eigen::Matrix<S, 4, 1> quaternion_of(const Eigen::Matrix<S, 3, 3>& rotation) {
  const Eigen::Quaternion<S> turn = Eigen::Quaternion<S>(rotation).normalized();
  return {turn.w(), turn.x(), turn.y(), turn.z()};
}

template <class S>
struct Batch<S>::Impl {
  struct Blocks {
    template <class E>
    using Rows = AlignedBlock<E>;
    template <class E>
    using Inputs = AlignedBlock<E>;
  };
  struct Numbers {
    template <class E>
    using Rows = std::vector<E>;
    template <class E>
    using Inputs = std::vector<E>;
  };

  Impl(const Plan& p, int count, const BatchOptions& options)
      : plan(p),
        environments(checked_environments(count, options)),
        target(resolve(options.target)),
        tables(lockstep::tables<S>(program_of(p))),
        kernels(kernels_for<S>(target)),
        chosen(choose_engine<S>(p, target, options.engine)),
        stride(row_stride<S>(count)),
        step_nanoseconds(static_cast<double>(p.flops_per_step()) /
                         ((chosen.engine == Engine::tables ? 3.0 : 8.0) * kernels.lanes)),
        frames(frames_of(p.model())),
        workers(options.threads, options.memory_domain, scratch_bytes()),
        rules(value_rules<S>(program_of(p))),
        placer(program_of(p)),
        pairs_of_link(pairs_of_links(p)),
        moved_link(moved_links(p.model())) {
    wanted.reserve(frames.size()), slot.resize(frames.size());
    workers.within([&] {
      each_block(
          tables,
          [&]<class E>(const BatchBlock& block, AlignedBlock<E>& own, std::vector<E>& first) {
            first.resize(static_cast<std::size_t>(block.rows));
            own = block_of<E>(block.rows);
          },
          rows, start);
    });
    find_start();
    require_representable(start);
    const Model& model = program_of(plan).model;
    for (const NamedPose& pose : model.poses) {
      poses.push_back(start);
      find_state(started_in(pose, model), poses.back());
      require_representable(poses.back());
    }
    each_block(
        tables,  // the padding as well: it is stepped, so it must be sound
        [&]<class E>(const BatchBlock&, const AlignedBlock<E>& own, const std::vector<E>& first) {
          for (std::size_t row = 0; row < first.size(); ++row)
            std::fill_n(own.data() + static_cast<std::ptrdiff_t>(row) * stride, stride, first[row]);
        },
        rows, start);
    for (int e = 0; e < stride; ++e) settle_drives(e);
    std::iota(rows.id.data(), rows.id.data() + stride, options.first_id);
    std::fill_n(rows.seed.data(), stride, options.seed);
  }

  // Where the numbers that read() asks for stand in a worker's scratch memory: behind what the kernels want.
  std::size_t frames_at() const { return (step_bytes() + cache_line - 1) / cache_line * cache_line; }

  std::size_t scratch_bytes() const {
    const std::size_t frame =
        kernels::frame_numbers + (tables.record_accelerations ? kernels::acceleration_numbers : 0);
    const std::size_t numbers = frame * frames.size() + static_cast<std::size_t>(tables.couplings) +
                                2 * static_cast<std::size_t>(tables.loops.loops.count) + 1;
    const std::size_t contacts = kernels::contact_numbers * static_cast<std::size_t>(tables.contacts.slots) + 1;
    return frames_at() + (numbers + contacts) * static_cast<std::size_t>(kernels.lanes) * sizeof(S);
  }

  std::size_t step_bytes() const {
    const std::size_t tile = kernels.scratch_bytes(tables),
                      number = static_cast<std::size_t>(kernels.lanes) * sizeof(S);
    if (chosen.compiled) return chosen.compiled->code.tiles * (tile + chosen.compiled->code.slots * number);
    return chosen.kernel ? chosen.kernel->tiles_per_call * (tile + chosen.kernel->carried_values * number) : tile;
  }

  template <class E>
  AlignedBlock<E> block_of(int count) const {
    return AlignedBlock<E>(static_cast<std::size_t>(count * stride));
  }

  // State and inputs as the model starts.
  void find_state(const Model& model, BatchRows<S, Numbers>& to) const {
    const auto by_dof = [&](const auto& number_of, int times = 1) {
      std::vector<S> numbers;
      for (int time = 0; time < times; ++time)
        for (const Joint& joint : model.joints)
          if (joint.moves()) numbers.push_back(static_cast<S>(number_of(joint)));
      return numbers;
    };
    const int times = tables.input_times;
    to.position = by_dof([](const Joint& j) { return j.position; });
    to.velocity = by_dof([](const Joint& j) { return j.velocity; });
    to.position_target = by_dof([](const Joint& j) { return j.drive.position_target; }, times);
    to.velocity_target = by_dof([](const Joint& j) { return j.drive.velocity_target; }, times);
    to.effort = by_dof([](const Joint& j) { return j.effort; }, times);
    to.root_pose.clear(), to.root_velocity.clear();
    for (const Root& root : model.roots) {
      if (!root.floating) continue;
      const Eigen::Vector3d at = root.pose.translation();
      const Eigen::Quaterniond turn(root.pose.linear());
      for (double number : {at.x(), at.y(), at.z(), turn.w(), turn.x(), turn.y(), turn.z()})
        to.root_pose.push_back(static_cast<S>(number));
      for (int i = 0; i < 6; ++i) to.root_velocity.push_back(static_cast<S>(root.velocity[i]));
    }
  }

  // Zero but for these.
  void find_start() {
    const Program& program = program_of(plan);
    find_state(program.model, start);
    const Fields& model = fields_of(program);
    for (int f = 0; f < parameter_count; ++f)
      for (std::size_t row = 0; row < std::min(start.fields[f].size(), model.values[f].size()); ++row)
        start.fields[f][row] = static_cast<S>(model.values[f][row]);
    constexpr S none = std::numeric_limits<S>::quiet_NaN();
    std::fill(start.angle.begin(), start.angle.end(), none);  // none is kept: see simd::turned()
    if (!start.contact_memory.empty())                        // no state is NaN, so nothing is remembered
      std::fill(start.contact_memory.begin() + tables.contacts.remembered_state(tables), start.contact_memory.end() - 1,
                none);
  }

  // The model's numbers are finite, so what is infinite was too large for S.
  void require_representable(const BatchRows<S, Numbers>& numbers) const {
    bool all = sizeof(S) > 4 || program_of(plan).fits_single;
    each_block(
        tables,
        [&]<class E>(const BatchBlock& block, const std::vector<E>& first) {
          if (block.parameter >= 0 && is_limit(Parameter(block.parameter))) return;  // some are infinite
          if constexpr (std::is_same_v<E, S>)
            all = all && std::none_of(first.begin(), first.end(), [](S number) { return std::isinf(number); });
        },
        numbers);
    if (!all)
      throw UsageError("numbers of model '" + plan.model().name + "'", "are beyond single precision",
                       "use Batch<double>");
  }

  // Rows of the kinds that are wanted begin anew.
  template <class Wanted>
  void begin(int e, const Wanted& wanted, const BatchRows<S, Numbers>& with) {
    each_block(
        tables,
        [&]<class E>(const BatchBlock& block, const AlignedBlock<E>& own, const std::vector<E>& first) {
          for (std::size_t row = 0; wanted(block.kind) && row < first.size(); ++row)
            own.data()[static_cast<std::ptrdiff_t>(row) * stride + e] = first[row];
        },
        rows, with);
  }

  // To the state of the model's start or of a pose.
  void reset(int e, bool keep_inputs) { reset(e, keep_inputs, start); }
  void reset(int e, bool keep_inputs, const BatchRows<S, Numbers>& to) {
    const auto wanted = [&](RowKind kind) {
      return kind == RowKind::state || kind == RowKind::memory || kind == RowKind::reading ||
             (kind == RowKind::input && !keep_inputs);
    };
    begin(e, wanted, to);
    settle_drives(e);
    ++rows.resets.data()[e];
  }

  // What is saved of one name (save.cpp).
  struct SavedRows {
    std::string name;
    RowKind kind;
    int rows;
    std::size_t number_bytes;
    std::byte* data;
    bool (*is_known)(const std::byte* number, int dofs);  // null if any number may be
  };
  std::vector<SavedRows> saved_rows() const;
  void restore(const Blob& blob, std::span<const int> into, std::span<const int> from, bool other_settings);

  // Whether numbers of the caller stand in memory of the batch.
  bool holds(const Extent& given) const {
    bool inside = false;
    each_block(
        tables,
        [&]<class E>(const BatchBlock&, const AlignedBlock<E>& block) {
          inside |= given.overlaps(Extent(block.data(), {{static_cast<std::ptrdiff_t>(block.size()), 1}}));
        },
        rows);
    return inside;
  }
  void require_foreign(const Extent& given, const char* element) const {
    if (holds(given)) throw UsageError(element, "lies in memory of the batch", "give memory of its own");
  }

  void reset(std::span<const int> ids, const Eigen::Ref<const Array>& positions,
             const Eigen::Ref<const Array>& velocities, const ResetOptions& options,
             std::vector<UnmetCoupling>& unmet) {
    for (const int id : ids) reset(id, options.keep_inputs);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      view(rows.position).col(ids[i]) = positions.col(static_cast<Eigen::Index>(i));
      view(rows.velocity).col(ids[i]) = velocities.col(static_cast<Eigen::Index>(i));
    }
    for (const int id : ids) project(id, options.project, unmet);
  }

  // To a pose, -1 for the model's start, with noise (starts.cpp).
  std::vector<UnmetCoupling> reset_to(const EnvironmentSet& which, int pose, const PoseNoise& noise);
  void check_noise(const PoseNoise& noise) const;
  void disturb_joints(int e, const PoseNoise& noise);
  void disturb_roots(int e, const PoseNoise& noise);

  void project(int e, Couplings couplings, std::vector<UnmetCoupling>& unmet) {
    const simd::StepMode mode;
    placer.project(e, couplings, state_pointers(), unmet);
  }

  // Values that an application may have written (check_values.cpp).
  bool normalise_roots(std::ptrdiff_t first, std::ptrdiff_t last);
  bool has_turn(std::ptrdiff_t e, int root) const;
  void check_values(std::ptrdiff_t first, std::ptrdiff_t last);
  S mass_of(const BodyLinks& body, std::ptrdiff_t e) const;
  bool is_possible(const InertiaRule<S>& rule, std::ptrdiff_t e) const;

  void check_id(int id) const { EnvironmentSet(std::span(&id, 1)).check(environments); }

  Draws draws(int e, unsigned stream, Purpose purpose) const {
    return {rows.seed.data()[e], rows.id.data()[e], rows.resets.data()[e], stream, purpose};
  }

  void check_link(int link) const {
    if (link < 0 || link >= tables.links)
      throw UsageError("link " + std::to_string(link), "is not part of the plan", "see Plan::link()");
  }

  const Site& site(int index) const {
    if (index < 0 || index >= static_cast<int>(plan.model().sites.size()))
      throw UsageError("site " + std::to_string(index), "is not part of the plan", "see Plan::site()");
    return plan.model().sites[index];
  }

  StatePointers<S> state_pointers() const {
    StatePointers<S> pointers;
    pointers.stride = stride;
    each_block(
        tables, [](const BatchBlock&, const auto& own, auto*& pointer) { pointer = own.data(); }, rows, pointers);
    return pointers;
  }

  // Drives that are late (actuators.cpp): as if what the batch shows had always stood there, what a step reads in its
  // place, and the numbers of lags that have changed.
  void settle_drives(int e);
  StatePointers<S> pointers_of_step() const;
  void find_lags(std::ptrdiff_t first, std::ptrdiff_t last);

  /// The first environments, or all, in whole tiles.
  std::ptrdiff_t stepped(int count) const {
    return static_cast<std::ptrdiff_t>((count + kernels.lanes - 1) / kernels.lanes) * kernels.lanes;
  }
  std::ptrdiff_t stepped() const { return stepped(environments); }

  void step(int substeps) { step(substeps, environments); }

  /// The first `count` environments.
  void step(int substeps, int count) {
    const StatePointers<S> l = pointers_of_step();
    const Advance<S> advance = chosen.kernel ? advance_of<S>(*chosen.kernel) : kernels.advance;
    const auto step_part = [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
      check_values(first, std::min<std::ptrdiff_t>(last, count));
      if (tables.actuators.lagged.count > 0) find_lags(first, last);
      if (chosen.compiled)
        kernels.advance_by_code(tables, l, first, last, substeps, scratch, chosen.compiled->code);
      else
        advance(tables, l, first, last, substeps, scratch);
      count_steps(first, last, static_cast<std::uint32_t>(substeps));
    };
    // Parts whose values are still in the cache when they are stepped.
    const std::ptrdiff_t most = rules.rows.empty() && tables.roots.count == 0 ? stepped(count) : 2048;
    workers.for_environments(stepped(count), step_nanoseconds * substeps, kernels.lanes,
                             [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
                               for (; first < last; first += most)
                                 step_part(first, std::min(first + most, last), scratch);
                             });
  }

  // Of environments that have failed, the kernel has counted.
  void count_steps(std::ptrdiff_t first, std::ptrdiff_t last, std::uint32_t substeps) {
    const Fault* const faults = rows.fault.data();
    std::uint32_t* const counts = rows.steps.data();
    for (std::ptrdiff_t e = first; e < last; ++e) counts[e] += faults[e] == Fault::none ? substeps : 0u;
  }

  // These two are for functions that hold the batch.
  Array read_held(const kernels::Request<S>& request, int row_count) {
    AlignedBlock<S> result = block_of<S>(row_count);
    const StatePointers<S> l = state_pointers();
    workers.for_environments(stepped(), step_nanoseconds, kernels.lanes,
                             [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
                               normalise_roots(first, std::min<std::ptrdiff_t>(last, environments));
                               kernels.read(tables, l, first, last, request, result.data(), stride, scratch);
                             });
    return View(result.data(), row_count, environments, Eigen::OuterStride<>(stride));
  }
  Array read_frame_held(kernels::Quantity quantity, int link, const Eigen::Vector3d& offset, int row_count) {
    kernels::Request<S> request{quantity, link};
    for (int k = 0; k < 3; ++k) request.offset[k] = static_cast<S>(offset[k]);
    return read_held(request, row_count);
  }
  Array read(const kernels::Request<S>& request, int row_count) {
    const Alone alone(in_use);
    return read_held(request, row_count);
  }

  // Angles or whole turns of the joints.
  Array read_turned(S JointTurns<S>::*part) const {
    Array result = Array(const_view(rows.position));
    for (int j = 0; j < tables.joints; ++j)
      for (int e = 0; e < environments; ++e) {
        const std::ptrdiff_t at = tables.dof[j] * stride + e;
        result(tables.dof[j], e) = turned(tables, j, rows.position.data()[at], rows.angle.data(), at).*part;
      }
    return result;
  }

  Array reduced_jacobians(int link, const Eigen::Vector3d& origin, const EnvironmentSet& which);

  Array read(kernels::Quantity quantity, int row_count) { return read(kernels::Request<S>{quantity}, row_count); }

  Array read_frame(kernels::Quantity quantity, int link, const Eigen::Vector3d& offset, int row_count) {
    const Alone alone(in_use);
    return read_frame_held(quantity, link, offset, row_count);
  }

  int frame_of(lockstep::Quantity quantity, int i) const;

  // The model's links, then its sites.
  static std::vector<kernels::Request<S>> frames_of(const Model& model) {
    std::vector<kernels::Request<S>> frames;
    for (std::size_t l = 0; l < model.links.size(); ++l)
      frames.push_back({kernels::Quantity::frame, static_cast<int>(l)});
    for (const Site& site : model.sites) {
      frames.push_back({kernels::Quantity::frame, model.link_index(site.link)});
      for (int k = 0; k < 3; ++k) frames.back().offset[k] = static_cast<S>(site.pose.translation()[k]);
    }
    return frames;
  }

  // Of a link: a pair of one of its colliders, and the sign of contact_force on it.
  static std::vector<int> moved_links(const Model& model) {
    std::vector<int> links;
    for (const Joint& joint : model.joints)
      if (joint.moves()) links.push_back(joint.child.empty() ? -1 : model.link_index(joint.child));
    return links;
  }

  struct PairOfLink {
    int pair, sign;
  };
  static std::vector<std::vector<PairOfLink>> pairs_of_links(const Plan& plan) {
    const Model& model = plan.model();
    std::vector<std::vector<PairOfLink>> pairs(model.links.size());
    const auto add = [&](int collider, PairOfLink pair) {
      const std::string& link = model.colliders[static_cast<std::size_t>(collider)].link;
      if (!link.empty()) pairs[static_cast<std::size_t>(model.link_index(link))].push_back(pair);
    };
    for (int pair = 0; pair < static_cast<int>(plan.contacts().size()); ++pair) {
      const PlanContact& contact = plan.contacts()[static_cast<std::size_t>(pair)];
      add(contact.first, {pair, -1}), add(contact.second, {pair, 1});
    }
    return pairs;
  }
  const std::vector<int>& commanded(const ActionMap& map) const;  // actions.cpp, as the next
  void set_actions(const StridedRows<const S>& actions, const ActionMap& map, const EnvironmentSet& which);
  void read(std::span<const Query> queries, const StridedRows<S>& out, int count);  // read.cpp

  class Links;          // links.h
  class TileReader;     // read.cpp
  class ProblemFinder;  // problems.cpp
  std::vector<Problem> bad_values(int environment) const;

  View view(const AlignedBlock<S>& block) const {
    return View(block.data(), static_cast<Eigen::Index>(block.size()) / stride, environments,
                Eigen::OuterStride<>(stride));
  }

  ConstView const_view(const AlignedBlock<S>& block) const {
    return ConstView(block.data(), static_cast<Eigen::Index>(block.size()) / stride, environments,
                     Eigen::OuterStride<>(stride));
  }

  std::atomic<bool> in_use{false};  ///< by a function that runs
  Plan plan;
  int environments;
  Target target;
  const Tables<S>& tables;
  const KernelSet<S>& kernels;
  ChosenEngine chosen;
  std::ptrdiff_t stride;
  double step_nanoseconds;                          // of one environment, about: for the size of tasks
  std::vector<kernels::Request<S>> frames, wanted;  // of all links, then sites; those that read() computes
  std::vector<int> slot;                            // by frame: its place in `wanted`
  Workers workers;
  ValueRules<S> rules;
  Placer<S> placer;
  BatchRows<S, Blocks> rows;
  BatchRows<S, Numbers> start;                         // one number for each row: what an environment begins with
  std::vector<BatchRows<S, Numbers>> poses;            // the same in each of Model::poses
  std::vector<std::vector<PairOfLink>> pairs_of_link;  // in the order of the plan's contacts
  std::vector<int> moved_link;                         // by dof: the child of its joint; -1 of a tendon
};

}  // namespace lockstep
