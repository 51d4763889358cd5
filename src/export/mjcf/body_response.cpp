// The mean response of a body's centre. SPDX-License-Identifier: Apache-2.0
#include "body_response.h"

#include <Eigen/Dense>
#include <cmath>

#include "lockstep/batch.h"
#include "lockstep/plan.h"

namespace lockstep::exporter::mjcf {

std::vector<double> body_responses(const Model& model, const Layout& layout) {
  // All joints free and at 0, and a site at the centre of each body.
  Model free = model;
  free.couplings.clear(), free.loops.clear(), free.contacts.clear(), free.poses.clear(), free.sites.clear();
  std::erase_if(free.joints, [](const Joint& joint) { return joint.kind == JointKind::tendon; });
  for (Joint& joint : free.joints) joint.drive = {}, joint.position = joint.velocity = 0.0;
  for (const Body& body : layout.bodies)
    free.sites.push_back({std::to_string(free.sites.size()), model.links[static_cast<std::size_t>(body.link)].name,
                          Pose(Eigen::Translation3d(body.inertial.center))});

  const Batch<double> batch(compile(free), 1, {.threads = 1});
  const auto elements = batch.mass_matrices();
  const auto size = static_cast<Eigen::Index>(std::lround(std::sqrt(static_cast<double>(elements.rows()))));
  std::vector<double> responses(model.links.size(), 0.0);
  if (size == 0) return responses;
  const Eigen::LDLT<Eigen::MatrixXd> factors(Eigen::MatrixXd(elements.matrix().reshaped(size, size)));
  for (std::size_t b = 0; b < layout.bodies.size(); ++b) {
    const Eigen::MatrixXd jacobian = batch.reduced_site_jacobians(static_cast<int>(b)).matrix().reshaped(6, size);
    const Eigen::MatrixXd linear = jacobian.bottomRows<3>();
    responses[static_cast<std::size_t>(layout.bodies[b].link)] =
        linear.transpose().cwiseProduct(factors.solve(linear.transpose())).sum() / 3.0;
  }
  return responses;
}

}  // namespace lockstep::exporter::mjcf
