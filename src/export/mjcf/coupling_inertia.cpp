// The mass matrix, from kinetic energies. SPDX-License-Identifier: Apache-2.0
#include "coupling_inertia.h"

#include <Eigen/Dense>

#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "model/tendons.h"

namespace lockstep::exporter::mjcf {
namespace {

// One environment for each two velocities: twice the energy of both less those of each is an element of the matrix.
Eigen::MatrixXd mass_matrix(const Plan& plan, int size) {
  Batch<double> batch(plan, size * (size + 1) / 2, {.threads = 1});
  const auto dofs = static_cast<int>(plan.dof_names().size());
  batch.velocities().setZero();
  batch.root_velocities().setZero();
  const auto move = [&](int velocity, int environment) {
    (velocity < dofs ? batch.velocities()(velocity, environment)
                     : batch.root_velocities()(velocity - dofs, environment)) = 1.0;
  };
  for (int i = 0, environment = 0; i < size; ++i)
    for (int j = 0; j <= i; ++j, ++environment) move(i, environment), move(j, environment);
  const auto energies = batch.kinetic_energies();
  Eigen::MatrixXd matrix(size, size);
  for (int i = 0, environment = 0; i < size; ++i)
    for (int j = 0; j <= i; ++j, ++environment) matrix(i, j) = 2.0 * energies(0, environment);
  const Eigen::VectorXd diagonal = matrix.diagonal();
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < i; ++j) matrix(i, j) = matrix(j, i) = 0.5 * (matrix(i, j) - diagonal[i] - diagonal[j]);
  return matrix;
}

}  // namespace

std::vector<double> coupling_inertias(const Model& model) {
  Model free = model;
  free.couplings.clear(), free.contacts.clear();
  std::erase_if(free.joints, [](const Joint& joint) { return joint.kind == JointKind::tendon; });
  for (Joint& joint : free.joints) joint.drive = {}, joint.velocity = 0.0;
  const Plan plan = compile(free, {.integrator = Integrator::euler});
  int size = static_cast<int>(plan.dof_names().size());
  for (const Root& root : model.roots) size += root.floating ? 6 : 0;
  const Eigen::LDLT<Eigen::MatrixXd> factors(mass_matrix(plan, size));
  std::vector<double> result;
  for (const Coupling& coupling : model.couplings) {
    if (tendon_of(coupling, model)) {
      result.push_back(0.0);
      continue;
    }
    Eigen::VectorXd form = Eigen::VectorXd::Zero(size);
    form[plan.dof(coupling.joint)] = 1.0;
    for (const CouplingTerm& term : coupling.terms) form[plan.dof(term.joint)] += term.ratio;
    result.push_back(1.0 / form.dot(factors.solve(form)));
  }
  return result;
}

}  // namespace lockstep::exporter::mjcf
