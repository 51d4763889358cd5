// Batch: views, stepping, resets, readbacks. SPDX-License-Identifier: Apache-2.0
#include "impl.h"

namespace lockstep {

using kernels::Quantity;

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
const Plan& Batch<S>::plan() const {
  return impl_->plan;
}
template <class S>
int Batch<S>::environments() const {
  return impl_->environments;
}
template <class S>
Engine Batch<S>::engine() const {
  return impl_->chosen.engine;
}
template <class S>
std::string Batch<S>::kernel_name() const {
  return impl_->chosen.kernel ? impl_->chosen.kernel->name : "";
}
template <class S>
Target Batch<S>::target() const {
  return impl_->target;
}

template <class S>
auto Batch<S>::positions() -> View {
  return impl_->view(impl_->position);
}
template <class S>
auto Batch<S>::velocities() -> View {
  return impl_->view(impl_->velocity);
}
template <class S>
auto Batch<S>::root_poses() -> View {
  return impl_->view(impl_->root_pose);
}
template <class S>
auto Batch<S>::root_velocities() -> View {
  return impl_->view(impl_->root_velocity);
}
template <class S>
auto Batch<S>::positions() const -> ConstView {
  return impl_->const_view(impl_->position);
}
template <class S>
auto Batch<S>::velocities() const -> ConstView {
  return impl_->const_view(impl_->velocity);
}
template <class S>
auto Batch<S>::root_poses() const -> ConstView {
  return impl_->const_view(impl_->root_pose);
}
template <class S>
auto Batch<S>::root_velocities() const -> ConstView {
  return impl_->const_view(impl_->root_velocity);
}
template <class S>
auto Batch<S>::position_targets() -> View {
  return impl_->view(impl_->position_target);
}
template <class S>
auto Batch<S>::velocity_targets() -> View {
  return impl_->view(impl_->velocity_target);
}
template <class S>
auto Batch<S>::efforts() -> View {
  return impl_->view(impl_->effort);
}

template <class S>
auto Batch<S>::parameter(Parameter parameter) -> View {
  if (!impl_->plan.settings().per_environment.contains(parameter))
    throw UsageError(std::string("field ") + to_string(parameter),
                     "was not declared, so it is the same for all environments",
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
    throw UsageError(
        "reset mask",
        "has " + std::to_string(mask.size()) + " entries for " + std::to_string(impl_->environments) + " environments",
        "give one per environment");
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
auto Batch<S>::coupling_errors() const -> Array {
  return impl_->read(Quantity::coupling_errors, impl_->tables.couplings);
}

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
    poses.col(e).tail(4) = quaternion_of(rotation);
  }
  return poses;
}

template <class S>
void Batch<S>::read_frames(const FrameRows<S>& rows) const {
  impl_->read_frames(rows);
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
  return impl_->read_frame(Quantity::frame_jacobian, impl_->plan.link(s.link), s.pose.translation(),
                           6 * impl_->tables.velocities);
}

template <class S>
auto Batch<S>::kinetic_energies() const -> Array {
  return impl_->read(Quantity::kinetic_energy, 1);
}
template <class S>
auto Batch<S>::potential_energies() const -> Array {
  return impl_->read(Quantity::potential_energy, 1);
}
template <class S>
auto Batch<S>::momenta() const -> Array {
  return impl_->read(Quantity::momentum, 6);
}

template class Batch<float>;
template class Batch<double>;

}  // namespace lockstep
