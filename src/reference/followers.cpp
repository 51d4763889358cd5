// Chooses the followers and corrects their positions. SPDX-License-Identifier: Apache-2.0
#include "followers.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/tendons.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// The follower of each coupling. First the followers chosen so far are replaced by the other joints. The follower is
// then the coupling's first joint, unless the coefficient of another joint is more than a thousand times larger.
std::vector<int> chosen_followers(const Mechanism& mechanism, const MatrixXd& rows, const std::vector<int>& couplings) {
  std::vector<int> followers;
  for (std::size_t p = 0; p < couplings.size(); ++p) {
    VectorXd remaining = rows.row(p);
    if (p > 0) {
      const MatrixXd before = rows.topRows(p);
      const MatrixXd expressed = before(Eigen::all, followers).fullPivLu().solve(before);
      for (std::size_t f = 0; f < p; ++f) remaining -= rows(p, followers[f]) * expressed.row(f).transpose();
      for (const int f : followers) remaining[f] = 0.0;
    }
    const int first = mechanism.root_velocities() + mechanism.dof(mechanism.model().couplings[couplings[p]].joint);
    int follower = 0;
    const double largest = remaining.cwiseAbs().maxCoeff(&follower);
    const Model& model = mechanism.model();
    if (tendon_of(model.couplings[couplings[p]], model) || std::abs(remaining[first]) * 1000.0 >= largest)
      follower = first;
    followers.push_back(follower);
  }
  return followers;
}

}  // namespace

VectorXd follower_corrections(const Mechanism& mechanism, const Stage& stage, const StepSettings& settings) {
  VectorXd w = VectorXd::Zero(stage.jacobian.cols());
  const ParameterSet& fields = settings.per_environment;
  if (fields.contains(Parameter::softness) || fields.contains(Parameter::coupling_switch)) return w;
  std::vector<int> hard;
  for (int c = 0; c < stage.couplings.count(); ++c)
    if (stage.rows[c].active && stage.rows[c].hard && !stage.rows[c].limited) hard.push_back(c);
  if (hard.empty()) return w;
  const MatrixXd rows = stage.jacobian(hard, Eigen::all);
  const std::vector<int> followers = chosen_followers(mechanism, rows, hard);
  w(followers) = -rows(Eigen::all, followers).fullPivLu().solve(stage.correction(hard));
  return w;
}

}  // namespace lockstep::reference
