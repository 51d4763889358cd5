// SPDX-License-Identifier: Apache-2.0
#include "record.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "state.h"

namespace lockstep::tool {

Recorder::Recorder(const std::string& path, int environment, const Plan& plan)
    : file_(std::in_place, path), environment_(environment) {
  std::vector<std::string> names = {"time"};
  const std::vector<StateColumn> columns = state_columns(plan, true);
  const auto dofs = columns.begin() + 2 * plan.dofs();
  for (auto column = columns.begin(); column != dofs; ++column) names.push_back(csv_field(column->name));
  for (const std::string& coupling : coupling_names(plan.model())) names.push_back(csv_field("C." + coupling));
  for (auto column = dofs; column != columns.end(); ++column) names.push_back(csv_field(column->name));
  for (const Site& site : plan.model().sites)
    for (const char* axis : {"x", "y", "z"}) names.push_back(csv_field(fmt::format("site.{}.{}", site.name, axis)));
  names.push_back("fault");
  file_->write(fmt::format("{}\n", fmt::join(names, ",")));
}

template <class S>
void Recorder::add(double time, Batch<S>& batch, const typename Batch<S>::Array& coupling_errors) {
  fmt::memory_buffer line;
  const auto append = [&line](auto number) { fmt::format_to(std::back_inserter(line), ",{}", number); };
  fmt::format_to(std::back_inserter(line), "{}", time);
  const auto positions = batch.positions(), velocities = batch.velocities();
  for (Eigen::Index i = 0; i < positions.rows(); ++i) {
    append(positions(i, environment_));
    append(velocities(i, environment_));
  }
  for (Eigen::Index c = 0; c < coupling_errors.rows(); ++c) append(coupling_errors(c, environment_));
  for (const auto& root : {batch.root_poses(), batch.root_velocities()})
    for (Eigen::Index i = 0; i < root.rows(); ++i) append(root(i, environment_));
  for (std::size_t site = 0; site < batch.plan().model().sites.size(); ++site) {
    const typename Batch<S>::Array place = batch.site_positions(static_cast<int>(site));
    for (int k = 0; k < 3; ++k) append(place(k, environment_));
  }
  append(static_cast<unsigned>(batch.faults()[environment_]));
  line.push_back('\n');
  file_->write(fmt::to_string(line));
}

void Recorder::close() {
  if (file_) file_->close();
}

template void Recorder::add(double, Batch<float>&, const Batch<float>::Array&);
template void Recorder::add(double, Batch<double>&, const Batch<double>::Array&);

}  // namespace lockstep::tool
