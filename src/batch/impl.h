// Batch::Impl: storage, stepping over tiles. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "blob.h"
#include "draws.h"
#include "engine.h"
#include "in_use.h"
#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "placer.h"
#include "plan/fields.h"
#include "plan/program.h"
#include "targets/dispatch.h"
#include "targets/registry.h"
#include "turned.h"
#include "values.h"
#include "workers.h"

namespace lockstep {

inline constexpr int most_environments = 1 << 24;

inline int checked_environments(int environments) {
  if (environments < 1 || environments > most_environments)
    throw SettingsError("environments",
                        "is " + std::to_string(environments) + ", outside 1 to " + std::to_string(most_environments),
                        "give 1 or more, in several batches if there are too many");
  return environments;
}

/// w, x, y, z
template <class S>
Eigen::Matrix<S, 4, 1> quaternion_of(const Eigen::Matrix<S, 3, 3>& rotation) {
  const Eigen::Quaternion<S> turn = Eigen::Quaternion<S>(rotation).normalized();
  return {turn.w(), turn.x(), turn.y(), turn.z()};
}

template <class S>
struct Batch<S>::Impl {
  Impl(const Plan& p, int count, const BatchOptions& options)
      : plan(p),
        environments(checked_environments(count)),
        target(resolve(options.target)),
        tables(lockstep::tables<S>(program_of(p))),
        kernels(kernels_for<S>(target)),
        chosen(choose_engine<S>(p, target, options.engine)),
        stride(row_stride<S>(count)),
        step_nanoseconds(static_cast<double>(p.flops_per_step()) /
                         ((chosen.engine == Engine::tables ? 3.0 : 8.0) * kernels.lanes)),
        frames(frames_of(p.model())),
        workers(options.threads, scratch_bytes()),
        rules(value_rules<S>(program_of(p))),
        placer(program_of(p)) {
    wanted.reserve(frames.size()), slot.resize(frames.size());
    const int dofs = tables.joints;
    position = rows(dofs);
    if (tables.turning.count > 0) angle = rows(dofs);
    velocity = rows(dofs);
    position_target = rows(dofs * tables.input_times);
    velocity_target = rows(dofs * tables.input_times);
    effort = rows(dofs * tables.input_times);
    if (tables.roots.count > 0) root_pose = rows(7 * tables.roots.count), root_velocity = rows(6 * tables.roots.count);
    if (tables.record_impulses) impulse = rows(tables.couplings);
    if (tables.audited) audit = rows(2);
    if (tables.contacts.used()) contact_memory = rows(tables.contacts.remembered(tables));
    if (tables.record_diagnostics)
      residual = rows(tables.reported.count), row_state = rows(tables.reported.count), energy = rows(4);
    for (int f = 0; f < parameter_count; ++f)
      if (plan.settings().per_environment.contains(static_cast<Parameter>(f)))
        field[f] = rows(plan.parameter_rows(static_cast<Parameter>(f)));
    const std::size_t counted = static_cast<std::size_t>(stride);
    fault = AlignedBlock<Fault>(counted), fault_place = AlignedBlock<FaultPlace>(counted);
    steps = AlignedBlock<std::uint32_t>(counted), resets = AlignedBlock<std::uint32_t>(counted);
    id = AlignedBlock<std::uint32_t>(counted), seed = AlignedBlock<std::uint64_t>(counted);
    std::iota(id.data(), id.data() + counted, options.first_id);
    std::fill_n(seed.data(), counted, options.seed);
    find_start();
    fill_parameters();
    for (int e = 0; e < stride; ++e) reset(e, false);  // the padding as well: it is stepped, so it must be sound
    std::fill_n(resets.data(), stride, 0u);
    require_representable();
  }

  // Where the numbers that read() asks for stand in a worker's scratch memory: behind what the kernels want.
  std::size_t frames_at() const { return (step_bytes() + cache_line - 1) / cache_line * cache_line; }

  std::size_t scratch_bytes() const {
    const std::size_t numbers = kernels::frame_numbers * frames.size() + static_cast<std::size_t>(tables.couplings) + 1;
    const std::size_t contacts = kernels::contact_numbers * static_cast<std::size_t>(tables.contacts.slots) + 1;
    return frames_at() + (numbers + contacts) * static_cast<std::size_t>(kernels.lanes) * sizeof(S);
  }

  std::size_t step_bytes() const {
    const std::size_t tile = kernels.scratch_bytes(tables),
                      number = static_cast<std::size_t>(kernels.lanes) * sizeof(S);
    if (chosen.operations) return std::max(tile, kernels.interpreter_bytes(tables, *chosen.operations));
    return chosen.kernel ? chosen.kernel->tiles_per_call * (tile + chosen.kernel->carried_values * number) : tile;
  }

  AlignedBlock<S> rows(int count) const { return AlignedBlock<S>(static_cast<std::size_t>(count * stride)); }

  void fill_row(AlignedBlock<S>& block, int row, double value) const {
    std::fill_n(block.data() + row * stride, stride, static_cast<S>(value));
  }

  // What reset() puts into a column of a block.
  struct Start {
    AlignedBlock<S>* block;
    std::vector<S> numbers;
    bool is_input;
  };

  void find_start() {
    const Program& program = program_of(plan);
    const auto by_dof = [&](const auto& number_of, int times = 1) {
      std::vector<S> numbers;
      for (int time = 0; time < times; ++time)
        for (const Joint& joint : program.model.joints)
          if (joint.moves()) numbers.push_back(static_cast<S>(number_of(joint)));
      return numbers;
    };
    const int times = tables.input_times;
    start = {
        {&position, by_dof([](const Joint& j) { return j.position; }), false},
        {&velocity, by_dof([](const Joint& j) { return j.velocity; }), false},
        {&position_target, by_dof([](const Joint& j) { return j.drive.position_target; }, times), true},
        {&velocity_target, by_dof([](const Joint& j) { return j.drive.velocity_target; }, times), true},
        {&effort, by_dof([](const Joint& j) { return j.effort; }, times), true},
    };
    std::vector<S> poses, twists;
    for (const Root& root : program.model.roots) {
      if (!root.floating) continue;
      const Eigen::Vector3d at = root.pose.translation();
      const Eigen::Quaterniond turn(root.pose.linear());
      for (double number : {at.x(), at.y(), at.z(), turn.w(), turn.x(), turn.y(), turn.z()})
        poses.push_back(static_cast<S>(number));
      for (int i = 0; i < 6; ++i) twists.push_back(static_cast<S>(root.velocity[i]));
    }
    if (angle.size() > 0)  // none is kept: see simd::turned()
      start.push_back({&angle,
                       std::vector<S>(static_cast<std::size_t>(tables.joints), std::numeric_limits<S>::quiet_NaN()),
                       false});
    start.push_back({&root_pose, std::move(poses), false});
    start.push_back({&root_velocity, std::move(twists), false});
  }

  void fill_parameters() {
    const Fields& model = fields_of(program_of(plan));
    for (int f = 0; f < parameter_count; ++f)
      for (std::size_t row = 0; field[f].size() > 0 && row < model.values[f].size(); ++row)
        fill_row(field[f], static_cast<int>(row), model.values[f][row]);
  }

  // The model's numbers are finite, so what is not was too large for S.
  void require_representable() const {
    bool all = sizeof(S) > 4 || program_of(plan).fits_single;
    for (const AlignedBlock<S>* block :
         {&position, &velocity, &root_pose, &root_velocity, &position_target, &velocity_target, &effort})
      all = all && view(*block).col(0).isFinite().all();
    for (int f = 0; f < parameter_count; ++f)  // the tables have the limits, of which some are infinite
      all = all && (is_limit(static_cast<Parameter>(f)) || view(field[f]).col(0).isFinite().all());
    if (!all)
      throw UsageError("model '" + plan.model().name + "'", "has numbers beyond single precision", "use Batch<double>");
  }

  // To the model's state.
  void reset(int e, bool keep_inputs) {
    for (const Start& part : start)
      for (std::size_t row = 0; row < part.numbers.size() && !(part.is_input && keep_inputs); ++row)
        part.block->data()[static_cast<std::ptrdiff_t>(row) * stride + e] = part.numbers[row];
    begin_audit(e);
    forget_contacts(e);
    fault.data()[e] = Fault::none, fault_place.data()[e] = {};
    steps.data()[e] = 0, ++resets.data()[e];
  }

  void begin_audit(int e) {
    for (int row = 0; row < 2 && audit.size() > 0; ++row) audit.data()[row * stride + e] = S(0);
  }

  // Rows as kernels/contacts/memory.h has them. No state is NaN, so the memory belongs to none.
  void forget_contacts(int e) {
    const auto count = static_cast<std::ptrdiff_t>(contact_memory.size()) / stride;
    for (std::ptrdiff_t row = 0; row < count; ++row)
      contact_memory.data()[row * stride + e] =
          row < 4 * tables.contacts.slots + 9 * tables.contacts.pairs.count || row + 1 == count
              ? S(0)
              : std::numeric_limits<S>::quiet_NaN();
  }

  // The memory of one block that is saved (save.cpp).
  struct SavedRows {
    const char* name;
    int rows;
    std::size_t number_bytes;
    std::byte* data;
  };
  std::vector<SavedRows> saved_rows() const;
  void restore(const Blob& blob, std::span<const int> into, std::span<const int> from, bool other_settings);

  // Whether numbers of the caller stand in the memory of the state.
  bool overlaps(const Eigen::Ref<const Array>& given) const {
    if (given.size() == 0) return false;
    const S* const first = given.data();
    const S* const last = first + (given.rows() - 1) * given.outerStride() + given.cols();
    const auto in = [&](const AlignedBlock<S>& block) {
      return std::less<>()(first, block.data() + block.size()) && std::less<>()(block.data(), last);
    };
    for (const Start& part : start)
      if (in(*part.block)) return true;
    return std::any_of(std::begin(field), std::end(field), in);
  }

  void reset(std::span<const int> ids, const Eigen::Ref<const Array>& positions,
             const Eigen::Ref<const Array>& velocities, const ResetOptions& options,
             std::vector<UnmetCoupling>& unmet) {
    for (const int id : ids) reset(id, options.keep_inputs);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      view(position).col(ids[i]) = positions.col(static_cast<Eigen::Index>(i));
      view(velocity).col(ids[i]) = velocities.col(static_cast<Eigen::Index>(i));
    }
    for (const int id : ids) project(id, options.project, unmet);
  }

  void project(int e, Couplings couplings, std::vector<UnmetCoupling>& unmet) {
    const simd::StepMode mode;
    const S* fields[parameter_count];
    for (int f = 0; f < parameter_count; ++f) fields[f] = field[f].data();
    placer.project(e, couplings, {stride, position.data(), velocity.data(), angle.data(), fields}, unmet);
  }

  // Values that an application may have written (check_values.cpp).
  bool normalise_roots(std::ptrdiff_t first, std::ptrdiff_t last);
  bool has_turn(std::ptrdiff_t e, int root) const;
  void check_values(std::ptrdiff_t first, std::ptrdiff_t last);
  S mass_of(const BodyLinks& body, std::ptrdiff_t e) const;
  bool is_possible(const InertiaRule<S>& rule, std::ptrdiff_t e) const;

  void check_id(int id) const { EnvironmentSet(std::span(&id, 1)).check(environments); }

  Draws draws(int e, unsigned stream, Purpose purpose) const {
    return {seed.data()[e], id.data()[e], resets.data()[e], stream, purpose};
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
    StatePointers<S> l;
    l.stride = stride;
    l.position = position.data();
    l.velocity = velocity.data();
    l.angle = angle.data();
    l.root_pose = root_pose.data();
    l.root_velocity = root_velocity.data();
    l.position_target = position_target.data();
    l.velocity_target = velocity_target.data();
    l.effort = effort.data();
    for (int f = 0; f < parameter_count; ++f) l.fields[f] = field[f].data();
    l.impulse = impulse.data();
    l.residual = residual.data();
    l.row_state = row_state.data();
    l.energy = energy.data();
    l.audit = audit.data();
    l.contact_memory = contact_memory.data();
    l.fault = fault.data(), l.place = fault_place.data(), l.steps = steps.data();
    return l;
  }

  /// Environments in whole tiles.
  std::ptrdiff_t stepped() const {
    return static_cast<std::ptrdiff_t>((environments + kernels.lanes - 1) / kernels.lanes) * kernels.lanes;
  }

  void step(int substeps) {
    const StatePointers<S> l = state_pointers();
    const OperationList* const operations = chosen.operations;
    const std::ptrdiff_t together = operations ? kernels.lanes * OperationList::tiles_at_once : kernels.lanes;
    const Advance<S> advance = chosen.kernel ? advance_of<S>(*chosen.kernel) : kernels.advance;
    const auto step_part = [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
      check_values(first, std::min<std::ptrdiff_t>(last, environments));
      if (operations)
        kernels.interpret(tables, l, first, last, substeps, scratch, *operations);
      else
        advance(tables, l, first, last, substeps, scratch);
      count_steps(first, last, static_cast<std::uint32_t>(substeps));
    };
    // Parts whose values are still in the cache when they are stepped.
    const std::ptrdiff_t most = rules.rows.empty() && tables.roots.count == 0 ? stepped() : 2048;
    workers.for_environments(stepped(), step_nanoseconds * substeps, together,
                             [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
                               for (; first < last; first += most)
                                 step_part(first, std::min(first + most, last), scratch);
                             });
  }

  // Of environments that have failed, the kernel has counted.
  void count_steps(std::ptrdiff_t first, std::ptrdiff_t last, std::uint32_t substeps) {
    const Fault* const faults = fault.data();
    std::uint32_t* const counts = steps.data();
    for (std::ptrdiff_t e = first; e < last; ++e) counts[e] += faults[e] == Fault::none ? substeps : 0u;
  }

  Array read(const kernels::Request<S>& request, int row_count) {
    const Alone alone(in_use);
    AlignedBlock<S> result = rows(row_count);
    const StatePointers<S> l = state_pointers();
    workers.for_environments(stepped(), step_nanoseconds, kernels.lanes,
                             [&](std::ptrdiff_t first, std::ptrdiff_t last, void* scratch) {
                               normalise_roots(first, std::min<std::ptrdiff_t>(last, environments));
                               kernels.read(tables, l, first, last, request, result.data(), stride, scratch);
                             });
    return View(result.data(), row_count, environments, Eigen::OuterStride<>(stride));
  }

  // Angles or whole turns of the joints.
  Array read_turned(S JointTurns<S>::*part) const {
    Array result = Array(const_view(position));
    for (int j = 0; j < tables.joints; ++j)
      for (int e = 0; e < environments; ++e) {
        const std::ptrdiff_t at = tables.dof[j] * stride + e;
        result(tables.dof[j], e) = turned(tables, j, position.data()[at], angle.data(), at).*part;
      }
    return result;
  }

  Array read(kernels::Quantity quantity, int row_count) { return read(kernels::Request<S>{quantity}, row_count); }

  Array read_frame(kernels::Quantity quantity, int link, const Eigen::Vector3d& offset, int row_count) {
    kernels::Request<S> request{quantity, link};
    for (int k = 0; k < 3; ++k) request.offset[k] = static_cast<S>(offset[k]);
    return read(request, row_count);
  }

  // The model's links, then its sites.
  static std::vector<kernels::Request<S>> frames_of(const Model& model) {
    std::vector<kernels::Request<S>> frames, wanted;  // of all links, then sites; those that read() computes
    std::vector<int> slot;                            // by frame: its place in `wanted`
    for (std::size_t l = 0; l < model.links.size(); ++l)
      frames.push_back({kernels::Quantity::frame, static_cast<int>(l)});
    for (const Site& site : model.sites) {
      frames.push_back({kernels::Quantity::frame, model.link_index(site.link)});
      for (int k = 0; k < 3; ++k) frames.back().offset[k] = static_cast<S>(site.pose.translation()[k]);
    }
    return frames;
  }

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
  std::vector<Start> start;
  AlignedBlock<S> position, velocity, angle, root_pose, root_velocity;
  AlignedBlock<S> position_target, velocity_target, effort, impulse, residual, row_state, energy, audit, contact_memory;
  AlignedBlock<S> field[parameter_count];
  AlignedBlock<Fault> fault;
  AlignedBlock<FaultPlace> fault_place;
  AlignedBlock<std::uint32_t> steps, resets, id;
  AlignedBlock<std::uint64_t> seed;
};

}  // namespace lockstep
