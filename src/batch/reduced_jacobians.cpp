// Batch::reduced_link_jacobians(): J S of (M146). SPDX-License-Identifier: Apache-2.0
#include "coordinates.h"
#include "impl.h"

namespace lockstep {

template <class S>
auto Batch<S>::Impl::reduced_jacobians(int link, const Eigen::Vector3d& origin, const EnvironmentSet& which) -> Array {
  std::vector<int> ids;
  which.for_each(environments, [&](int e) { ids.push_back(e); });
  const StatePointers<S> state = state_pointers();
  check_couplings_hold(plan, state, ids);
  const Array all = read_frame(kernels::Quantity::frame_jacobian, link, origin, 6 * tables.velocities);
  Coordinates<S> coordinates(plan);
  Array reduced(6 * coordinates.count(), static_cast<Eigen::Index>(ids.size()));
  for (std::size_t i = 0; i < ids.size(); ++i) {
    coordinates.find(state, ids[i]);
    const Eigen::VectorXd own = all.col(ids[i]).matrix().template cast<double>();
    const Eigen::MatrixXd columns = own.reshaped(6, coordinates.velocities()) * coordinates.shares();
    reduced.col(static_cast<Eigen::Index>(i)) = columns.reshaped().template cast<S>().array();
  }
  return reduced;
}

template <class S>
auto Batch<S>::reduced_link_jacobians(int link, const EnvironmentSet& which) const -> Array {
  impl().check_link(link);
  return impl().reduced_jacobians(link, Eigen::Vector3d::Zero(), which);
}

template <class S>
auto Batch<S>::reduced_site_jacobians(int site, const EnvironmentSet& which) const -> Array {
  const Site& frame = impl().site(site);
  return impl().reduced_jacobians(impl().plan.link(frame.link), frame.pose.translation(), which);
}

template auto Batch<float>::reduced_link_jacobians(int, const EnvironmentSet&) const -> Array;
template auto Batch<double>::reduced_link_jacobians(int, const EnvironmentSet&) const -> Array;
template auto Batch<float>::reduced_site_jacobians(int, const EnvironmentSet&) const -> Array;
template auto Batch<double>::reduced_site_jacobians(int, const EnvironmentSet&) const -> Array;

}  // namespace lockstep
