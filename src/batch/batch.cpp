// Batch: storage, views, stepping over tiles, readbacks. SPDX-License-Identifier: Apache-2.0
#include "lockstep/batch.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "../plan/program.h"
#include "../targets/dispatch.h"
#include "lockstep/error.h"
#include "workers.h"

namespace lockstep {

using kernels::Quantity;
using kernels::Request;

const char* name(Fault fault) noexcept {
  switch (fault) {
    case Fault::none: break;
    case Fault::not_finite: return "not_finite";
    case Fault::diverged: return "diverged";
    case Fault::singular: return "singular";
  }
  return "none";
}

namespace {

int checked_environments(int environments) {
  if (environments < 1)
    throw SettingsError("environments", "is " + std::to_string(environments) + ", not a positive number", "give 1 or more");
  return environments;
}

}  // namespace

template <class S>
struct Batch<S>::Impl {
  Impl(const Plan& p, int count, const BatchOptions& options)
      : plan(p), environments(checked_environments(count)), target(resolve(options.target)),
        tables(lockstep::tables<S>(p.program())), kernels(kernels_for<S>(target)),
        stride(row_stride<S>(count)), workers(options.threads, kernels.scratch_bytes(tables)) {
    if (options.threads < 0)
      throw SettingsError("threads", "is negative", "give 0 for all, or a number");
    const int dofs = tables.joints;
    position = rows(dofs);
    velocity = rows(dofs);
    position_target = rows(dofs);
    velocity_target = rows(dofs);
    effort = rows(dofs);
    if (tables.floating) root_pose = rows(7), root_velocity = rows(6);
    if (tables.record_impulses) impulse = rows(tables.couplings);
    if (tables.record_diagnostics)
      residual = rows(tables.reported.count), row_state = rows(tables.reported.count), energy = rows(4);
    for (int f = 0; f < parameter_count; ++f)
      if (plan.settings().per_environment.contains(static_cast<Parameter>(f)))
        field[f] = rows(plan.parameter_rows(static_cast<Parameter>(f)));
    fault = AlignedBlock<Fault>(static_cast<std::size_t>(stride));
    fill_inputs();
    fill_parameters();
    for (int e = 0; e < stride; ++e) reset(e);  // the padding as well: it is stepped, so it must be sound
    require_representable();
  }

  AlignedBlock<S> rows(int count) const { return AlignedBlock<S>(static_cast<std::size_t>(count * stride)); }

  void fill_row(AlignedBlock<S>& block, int row, double value) const {
    std::fill_n(block.data() + row * stride, stride, static_cast<S>(value));
  }

  void fill_inputs() {
    const Program& program = plan.program();
    for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
      const int row = program.dof_of_joint[j];
      if (row < 0) continue;
      const Joint& joint = program.model.joints[j];
      fill_row(position_target, row, joint.drive.position_target);
      fill_row(velocity_target, row, joint.drive.velocity_target);
      fill_row(effort, row, joint.effort);
    }
  }

  void fill_parameters() {
    const Program& program = plan.program();
    const Model& model = program.model;
    const auto fill = [&](Parameter p, int row, double value) {
      AlignedBlock<S>& block = field[static_cast<int>(p)];
      if (block.size() > 0) fill_row(block, row, value);
    };
    int gear = 0;
    for (std::size_t c = 0; c < model.couplings.size(); ++c) {
      const Coupling& coupling = model.couplings[c];
      const int row = static_cast<int>(c);
      for (const CouplingTerm& term : coupling.terms) fill(Parameter::gear_ratio, gear++, term.ratio);
      fill(Parameter::offset, row, coupling.offset);
      fill(Parameter::coupling_switch, row, 1.0);
      fill(Parameter::softness, 2 * row, coupling.softness.first);
      fill(Parameter::softness, 2 * row + 1, coupling.softness.second);
    }
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      const int row = program.dof_of_joint[j];
      if (row < 0) continue;
      fill(Parameter::drive_gains, 2 * row, model.joints[j].drive.kp);
      fill(Parameter::drive_gains, 2 * row + 1, model.joints[j].drive.kd);
      fill(Parameter::damping, row, model.joints[j].damping);
    }
    for (std::size_t l = 0; l < model.links.size(); ++l)
      fill(Parameter::mass, static_cast<int>(l), model.links[l].inertia.mass);
    for (int k = 0; k < 3; ++k) fill(Parameter::gravity, k, model.gravity[k]);
  }

  // The model's numbers are finite, so what is not was too large for S.
  void require_representable() const {
    bool all = sizeof(S) > 4 || plan.program().fits_single;
    for (const AlignedBlock<S>* block : {&position, &velocity, &root_pose, &root_velocity, &position_target,
                                         &velocity_target, &effort})
      all = all && view(*block).col(0).isFinite().all();
    for (const AlignedBlock<S>& block : field) all = all && view(block).col(0).isFinite().all();
    if (!all)
      throw UsageError("model '" + plan.model().name + "'", "has numbers beyond single precision", "use Batch<double>");
  }

  // To the model's state.
  void reset(int e) {
    const Program& program = plan.program();
    for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
      const int row = program.dof_of_joint[j];
      if (row < 0) continue;
      position.data()[row * stride + e] = static_cast<S>(program.model.joints[j].position);
      velocity.data()[row * stride + e] = static_cast<S>(program.model.joints[j].velocity);
    }
    if (tables.floating) {
      const Root& root = program.model.root;
      const Eigen::Quaterniond turn(root.pose.linear());
      const double pose[7] = {root.pose.translation().x(), root.pose.translation().y(), root.pose.translation().z(),
                              turn.w(), turn.x(), turn.y(), turn.z()};
      for (int i = 0; i < 7; ++i) root_pose.data()[i * stride + e] = static_cast<S>(pose[i]);
      for (int i = 0; i < 6; ++i) root_velocity.data()[i * stride + e] = static_cast<S>(root.velocity[i]);
    }
    fault.data()[e] = Fault::none;
  }

  void check_id(int id) const {
    if (id < 0 || id >= environments)
      throw UsageError("environment " + std::to_string(id), "is outside the batch of " + std::to_string(environments),
                       "give 0 to " + std::to_string(environments - 1));
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

  Lanes<S> lanes() const {
    Lanes<S> l;
    l.stride = stride;
    l.position = position.data();
    l.velocity = velocity.data();
    l.root_pose = root_pose.data();
    l.root_velocity = root_velocity.data();
    l.position_target = position_target.data();
    l.velocity_target = velocity_target.data();
    l.effort = effort.data();
    for (int f = 0; f < parameter_count; ++f) l.field[f] = field[f].data();
    l.impulse = impulse.data();
    l.residual = residual.data();
    l.row_state = row_state.data();
    l.energy = energy.data();
    l.fault = fault.data();
    return l;
  }

  int tiles() const { return (environments + kernels.lanes - 1) / kernels.lanes; }

  void step(int substeps) {
    const Lanes<S> l = lanes();
    workers.for_tiles(tiles(), [&](int first, int last, void* scratch) {
      kernels.advance(tables, l, static_cast<std::ptrdiff_t>(first) * kernels.lanes,
                      static_cast<std::ptrdiff_t>(last) * kernels.lanes, substeps, scratch);
    });
  }

  Array read(const Request<S>& request, int row_count) {
    AlignedBlock<S> result = rows(row_count);
    const Lanes<S> l = lanes();
    workers.for_tiles(tiles(), [&](int first, int last, void* scratch) {
      kernels.read(tables, l, static_cast<std::ptrdiff_t>(first) * kernels.lanes,
                   static_cast<std::ptrdiff_t>(last) * kernels.lanes, request, result.data(), stride, scratch);
    });
    return View(result.data(), row_count, environments, Eigen::OuterStride<>(stride));
  }

  Array read(Quantity quantity, int row_count) { return read(Request<S>{quantity}, row_count); }

  Array read_frame(Quantity quantity, int link, const Eigen::Vector3d& offset, int row_count) {
    Request<S> request{quantity, link};
    for (int k = 0; k < 3; ++k) request.offset[k] = static_cast<S>(offset[k]);
    return read(request, row_count);
  }

  View view(const AlignedBlock<S>& block) const {
    return View(block.data(), static_cast<Eigen::Index>(block.size()) / stride, environments, Eigen::OuterStride<>(stride));
  }

  ConstView const_view(const AlignedBlock<S>& block) const {
    return ConstView(block.data(), static_cast<Eigen::Index>(block.size()) / stride, environments,
                     Eigen::OuterStride<>(stride));
  }

  Plan plan;
  int environments;
  Target target;
  const Tables<S>& tables;
  const KernelSet<S>& kernels;
  std::ptrdiff_t stride;
  Workers workers;
  AlignedBlock<S> position, velocity, root_pose, root_velocity;
  AlignedBlock<S> position_target, velocity_target, effort, impulse, residual, row_state, energy;
  AlignedBlock<S> field[parameter_count];
  AlignedBlock<Fault> fault;
};

template <class S>
Batch<S>::Batch(const Plan& plan, int environments, const BatchOptions& options)
    : impl_(std::make_unique<Impl>(plan, environments, options)) {}
template <class S>
Batch<S>::~Batch() = default;
template <class S>
Batch<S>::Batch(Batch&&) noexcept = default;
template <class S>
Batch<S>& Batch<S>::operator=(Batch&&) noexcept = default;

template <class S>
const Plan& Batch<S>::plan() const { return impl_->plan; }
template <class S>
int Batch<S>::environments() const { return impl_->environments; }
template <class S>
Target Batch<S>::target() const { return impl_->target; }

template <class S>
auto Batch<S>::positions() -> View { return impl_->view(impl_->position); }
template <class S>
auto Batch<S>::velocities() -> View { return impl_->view(impl_->velocity); }
template <class S>
auto Batch<S>::root_poses() -> View { return impl_->view(impl_->root_pose); }
template <class S>
auto Batch<S>::root_velocities() -> View { return impl_->view(impl_->root_velocity); }
template <class S>
auto Batch<S>::positions() const -> ConstView { return impl_->const_view(impl_->position); }
template <class S>
auto Batch<S>::velocities() const -> ConstView { return impl_->const_view(impl_->velocity); }
template <class S>
auto Batch<S>::root_poses() const -> ConstView { return impl_->const_view(impl_->root_pose); }
template <class S>
auto Batch<S>::root_velocities() const -> ConstView { return impl_->const_view(impl_->root_velocity); }
template <class S>
auto Batch<S>::position_targets() -> View { return impl_->view(impl_->position_target); }
template <class S>
auto Batch<S>::velocity_targets() -> View { return impl_->view(impl_->velocity_target); }
template <class S>
auto Batch<S>::efforts() -> View { return impl_->view(impl_->effort); }

template <class S>
auto Batch<S>::parameter(Parameter parameter) -> View {
  if (!impl_->plan.settings().per_environment.contains(parameter))
    throw UsageError(std::string("field ") + name(parameter), "was not declared, so it is the same for all environments",
                     "add it to StepSettings::per_environment");
  return impl_->view(impl_->field[static_cast<int>(parameter)]);
}

template <class S>
void Batch<S>::step(int substeps) noexcept {
  if (substeps > 0) impl_->step(substeps);
}

template <class S>
void Batch<S>::reset() {
  for (int e = 0; e < impl_->environments; ++e) impl_->reset(e);
}

template <class S>
void Batch<S>::reset(std::span<const bool> mask) {
  if (mask.size() != static_cast<std::size_t>(impl_->environments))
    throw UsageError("reset mask", "has " + std::to_string(mask.size()) + " entries for " +
                                       std::to_string(impl_->environments) + " environments", "give one per environment");
  for (int e = 0; e < impl_->environments; ++e)
    if (mask[e]) impl_->reset(e);
}

template <class S>
void Batch<S>::reset(std::span<const int> ids) {
  for (int id : ids) impl_->check_id(id);
  for (int id : ids) impl_->reset(id);
}

template <class S>
void Batch<S>::reset(std::span<const int> ids, const Eigen::Ref<const Array>& new_positions,
                     const Eigen::Ref<const Array>& new_velocities) {
  const Eigen::Index dofs = impl_->tables.joints, count = static_cast<Eigen::Index>(ids.size());
  for (const auto& given : {new_positions, new_velocities})
    if (given.rows() != dofs || given.cols() != count)
      throw UsageError("reset state", "is " + std::to_string(given.rows()) + " x " + std::to_string(given.cols()),
                       "give " + std::to_string(dofs) + " dofs x " + std::to_string(count) + " environments");
  reset(ids);
  for (Eigen::Index i = 0; i < count; ++i) {
    positions().col(ids[i]) = new_positions.col(i);
    velocities().col(ids[i]) = new_velocities.col(i);
  }
}

template <class S>
std::span<const Fault> Batch<S>::faults() const {
  return {impl_->fault.data(), static_cast<std::size_t>(impl_->environments)};
}

template <class S>
int Batch<S>::faulted() const {
  int count = 0;
  for (Fault fault : faults()) count += fault != Fault::none;
  return count;
}

template <class S>
auto Batch<S>::coupling_errors() const -> Array { return impl_->read(Quantity::coupling_errors, impl_->tables.couplings); }

template <class S>
auto Batch<S>::coupling_impulses() const -> Array {
  if (!impl_->tables.record_impulses)
    throw UsageError("coupling impulses", "are not kept by this plan", "set StepSettings::record_impulses");
  return impl_->view(impl_->impulse);
}

template <class S>
auto Batch<S>::link_poses(int link) const -> Array {
  impl_->check_link(link);
  const Array frame = impl_->read_frame(Quantity::frame, link, Eigen::Vector3d::Zero(), 12);
  Array poses(7, frame.cols());
  poses.topRows(3) = frame.topRows(3);
  for (Eigen::Index e = 0; e < frame.cols(); ++e) {
    Eigen::Matrix<S, 3, 3> rotation;
    for (int k = 0; k < 9; ++k) rotation(k / 3, k % 3) = frame(3 + k, e);
    const Eigen::Quaternion<S> turn = Eigen::Quaternion<S>(rotation).normalized();
    poses.col(e).tail(4) << turn.w(), turn.x(), turn.y(), turn.z();
  }
  return poses;
}

template <class S>
auto Batch<S>::link_velocities(int link) const -> Array {
  impl_->check_link(link);
  return impl_->read_frame(Quantity::frame_velocity, link, Eigen::Vector3d::Zero(), 6);
}

template <class S>
auto Batch<S>::site_positions(int site) const -> Array {
  const Site& s = impl_->site(site);
  return impl_->read_frame(Quantity::frame_position, impl_->plan.link(s.link), s.pose.translation(), 3);
}

template <class S>
auto Batch<S>::site_jacobians(int site) const -> Array {
  const Site& s = impl_->site(site);
  return impl_->read_frame(Quantity::frame_jacobian, impl_->plan.link(s.link), s.pose.translation(), 6 * impl_->tables.velocities);
}

template <class S>
auto Batch<S>::kinetic_energies() const -> Array { return impl_->read(Quantity::kinetic_energy, 1); }
template <class S>
auto Batch<S>::potential_energies() const -> Array { return impl_->read(Quantity::potential_energy, 1); }
template <class S>
auto Batch<S>::momenta() const -> Array { return impl_->read(Quantity::momentum, 6); }

template class Batch<float>;
template class Batch<double>;

}  // namespace lockstep
