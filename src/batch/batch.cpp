// Batch: views, stepping, resets, readbacks. SPDX-License-Identifier: Apache-2.0

#include "impl.h"

namespace lockstep {

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
  return impl().plan;
}
template <class S>
int Batch<S>::environments() const {
  return impl().environments;
}
template <class S>
Engine Batch<S>::engine() const {
  return impl().chosen.engine;
}
template <class S>
std::string Batch<S>::kernel_name() const {
  return impl().chosen.kernel ? impl().chosen.kernel->name : "";
}
template <class S>
int Batch<S>::threads() const {
  return impl().workers.concurrency();
}
template <class S>
Target Batch<S>::target() const {
  return impl().target;
}

template <class S>
auto Batch<S>::positions() -> View {
  return impl().view(impl().rows.position);
}
template <class S>
auto Batch<S>::velocities() -> View {
  return impl().view(impl().rows.velocity);
}
template <class S>
auto Batch<S>::root_poses() -> View {
  return impl().view(impl().rows.root_pose);
}
template <class S>
auto Batch<S>::root_velocities() -> View {
  return impl().view(impl().rows.root_velocity);
}
template <class S>
auto Batch<S>::positions() const -> ConstView {
  return impl().const_view(impl().rows.position);
}
template <class S>
auto Batch<S>::velocities() const -> ConstView {
  return impl().const_view(impl().rows.velocity);
}
template <class S>
auto Batch<S>::root_poses() const -> ConstView {
  return impl().const_view(impl().rows.root_pose);
}
template <class S>
auto Batch<S>::root_velocities() const -> ConstView {
  return impl().const_view(impl().rows.root_velocity);
}
template <class S>
auto Batch<S>::position_targets() -> View {
  return impl().view(impl().rows.position_target);
}
template <class S>
auto Batch<S>::velocity_targets() -> View {
  return impl().view(impl().rows.velocity_target);
}
template <class S>
auto Batch<S>::efforts() -> View {
  return impl().view(impl().rows.effort);
}

template <class S>
auto Batch<S>::parameter(Parameter parameter) -> View {
  if (static_cast<unsigned>(parameter) >= parameter_count)
    throw UsageError("field " + std::to_string(static_cast<unsigned>(parameter)), "is none of the enumerators",
                     "give one of Parameter");
  if (!impl().plan.settings().per_environment.contains(parameter))
    throw UsageError(std::string("field ") + to_string(parameter),
                     "was not declared, so it is the same for all environments",
                     "add it to StepSettings::per_environment");
  return impl().view(impl().rows.field(parameter));
}

template <class S>
auto Batch<S>::impl() const -> Impl& {
  if (!impl_) throw UsageError("batch", "was moved from, so it holds nothing", "use the batch that it was moved to");
  return *impl_;
}

template <class S>
bool Batch<S>::step(int substeps) noexcept {
  if (!impl_ || substeps <= 0) return true;
  const InUse in_use(impl_->in_use);
  if (in_use.alone()) impl_->step(substeps);
  return in_use.alone();
}

template <class S>
bool Batch<S>::step(int substeps, const std::function<void(int)>& before) {
  if (!before) throw UsageError("function before each step", "is empty", "give one, or call step() without it");
  for (int i = 0; i < substeps; ++i) {
    before(i);
    if (!step()) return false;
  }
  return true;
}

template <class S>
void Batch<S>::reset(const EnvironmentSet& which, const ResetOptions& options) {
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  which.for_each(batch.environments, [&](int e) { batch.reset(e, options.keep_inputs); });
}

template <class S>
std::vector<UnmetCoupling> Batch<S>::reset(std::span<const int> ids, const Eigen::Ref<const Array>& new_positions,
                                           const Eigen::Ref<const Array>& new_velocities, const ResetOptions& options) {
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  const Eigen::Index dofs = batch.tables.joints, count = static_cast<Eigen::Index>(ids.size());
  for (const auto* given : {&new_positions, &new_velocities})
    if (given->rows() != dofs || given->cols() != count)
      throw UsageError("reset state", "is " + std::to_string(given->rows()) + " x " + std::to_string(given->cols()),
                       "give " + std::to_string(dofs) + " dofs x " + std::to_string(count) + " environments");
  for (int id : ids) batch.check_id(id);
  check_couplings(options.project);
  std::vector<UnmetCoupling> unmet;
  const auto extent_of = [](const auto& given) {
    return Extent(given.data(), {{given.rows(), given.outerStride()}, {given.cols(), 1}});
  };
  if (batch.holds(extent_of(new_positions)) || batch.holds(extent_of(new_velocities))) {  // they change meanwhile
    const Array positions_before = new_positions, velocities_before = new_velocities;
    batch.reset(ids, positions_before, velocities_before, options, unmet);
  } else {
    batch.reset(ids, new_positions, new_velocities, options, unmet);
  }
  return unmet;
}

template <class S>
std::vector<UnmetCoupling> Batch<S>::project(const EnvironmentSet& which, Couplings couplings) {
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  check_couplings(couplings);
  std::vector<UnmetCoupling> unmet;
  which.for_each(batch.environments, [&](int e) { batch.project(e, couplings, unmet); });
  return unmet;
}

template <class S>
void Batch<S>::forget_contacts(const EnvironmentSet& which) {
  Impl& batch = impl();
  const Alone alone(batch.in_use);
  if (!batch.tables.contacts.used()) {
    which.check(batch.environments);
    return;
  }
  const int first = batch.tables.contacts.remembered_state(batch.tables),
            last = batch.tables.contacts.remembered(batch.tables) - 1;
  which.for_each(batch.environments, [&](int e) {
    for (int row = first; row < last; ++row)
      batch.rows.contact_memory.data()[row * batch.stride + e] =
          batch.start.contact_memory[static_cast<std::size_t>(row)];
  });
}

template <class S>
std::span<const Fault> Batch<S>::faults() const {
  return {impl().rows.fault.data(), static_cast<std::size_t>(impl().environments)};
}

template <class S>
int Batch<S>::faulted() const {
  int count = 0;
  for (Fault fault : faults()) count += fault != Fault::none;
  return count;
}

template <class S>
FaultReport Batch<S>::fault_report(int environment) const {
  impl().check_id(environment);
  const Fault fault = impl().rows.fault.data()[environment];
  if (fault == Fault::none) return {};
  const FaultPlace& place = impl().rows.place.data()[environment];
  const std::uint32_t step = impl().rows.steps.data()[environment];
  return {fault, place.stage, place.dof, step, step * plan().settings().dt};
}

template <class S>
std::span<const std::uint32_t> Batch<S>::steps() const {
  return {impl().rows.steps.data(), static_cast<std::size_t>(impl().environments)};
}
template <class S>
std::span<std::uint32_t> Batch<S>::resets() {
  return {impl().rows.resets.data(), static_cast<std::size_t>(impl().environments)};
}
template <class S>
std::span<const std::uint32_t> Batch<S>::resets() const {
  return {impl().rows.resets.data(), static_cast<std::size_t>(impl().environments)};
}

template <class S>
auto Batch<S>::coupling_errors() const -> Array {
  return impl().read(kernels::Quantity::coupling_errors, impl().tables.couplings);
}

template <class S>
auto Batch<S>::loop_errors() const -> Array {
  Array errors = impl().read(kernels::Quantity::loop_errors, 2 * impl().tables.loops.loops.count);
  for (Eigen::Index row = 1; row < errors.rows(); row += 2)
    errors.row(row) = errors.row(row).unaryExpr(&angle_of_gap<S>);
  return errors;
}

template <class S>
auto Batch<S>::coupling_impulses() const -> Array {
  if (!impl().tables.record_impulses)
    throw UsageError("coupling impulses", "are not kept by this plan", "set StepSettings::record_impulses");
  return impl().view(impl().rows.impulse);
}

template <class S>
auto Batch<S>::angles() const -> Array {
  return impl().read_turned(&JointTurns<S>::angle);
}
template <class S>
auto Batch<S>::turns() const -> Array {
  return impl().read_turned(&JointTurns<S>::turns);
}

template <class S>
auto Batch<S>::link_poses(int link) const -> Array {
  impl().check_link(link);
  const Array frame = impl().read_frame(kernels::Quantity::frame, link, Eigen::Vector3d::Zero(), 12);
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
auto Batch<S>::link_velocities(int link) const -> Array {
  impl().check_link(link);
  return impl().read_frame(kernels::Quantity::frame_velocity, link, Eigen::Vector3d::Zero(), 6);
}

template <class S>
auto Batch<S>::site_positions(int site) const -> Array {
  const Site& s = impl().site(site);
  return impl().read_frame(kernels::Quantity::frame_position, impl().plan.link(s.link), s.pose.translation(), 3);
}

template <class S>
auto Batch<S>::site_jacobians(int site) const -> Array {
  const Site& s = impl().site(site);
  return impl().read_frame(kernels::Quantity::frame_jacobian, impl().plan.link(s.link), s.pose.translation(),
                           6 * impl().tables.velocities);
}

template <class S>
auto Batch<S>::kinetic_energies() const -> Array {
  return impl().read(kernels::Quantity::kinetic_energy, 1);
}
template <class S>
auto Batch<S>::potential_energies() const -> Array {
  return impl().read(kernels::Quantity::potential_energy, 1);
}
template <class S>
auto Batch<S>::momenta() const -> Array {
  return impl().read(kernels::Quantity::momentum, 6);
}

template class Batch<float>;
template class Batch<double>;

}  // namespace lockstep
