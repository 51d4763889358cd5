// Which joints follow, and how they are corrected. SPDX-License-Identifier: Apache-2.0
#include "followers.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A coupling's first joint unless another one's coefficient is a thousand times larger, in what is left of the
// coupling when the followers so far are expressed by the others.
std::vector<int> chosen_followers(const Mechanism& mechanism, const MatrixXd& rows, const std::vector<int>& couplings) {
  std::vector<int> followers;
  for (std::size_t p = 0; p < couplings.size(); ++p) {
    VectorXd left = rows.row(p);
    if (p > 0) {
      const MatrixXd before = rows.topRows(p);
      const MatrixXd expressed = before(Eigen::all, followers).fullPivLu().solve(before);
      for (std::size_t f = 0; f < p; ++f) left -= rows(p, followers[f]) * expressed.row(f).transpose();
      for (const int f : followers) left[f] = 0.0;
    }
    const int first = mechanism.root_velocities() + mechanism.dof(mechanism.model().couplings[couplings[p]].joint);
    int follower = 0;
    const double largest = left.cwiseAbs().maxCoeff(&follower);
    if (std::abs(left[first]) * 1000.0 >= largest) follower = first;
    followers.push_back(follower);
  }
  return followers;
}

}  // namespace

VectorXd follower_corrections(const Mechanism& mechanism, const Stage& stage, const StepSettings& settings) {
  VectorXd w = VectorXd::Zero(stage.jacobian.cols());
  const ParameterSet& differ = settings.per_environment;
  if (differ.contains(Parameter::softness) || differ.contains(Parameter::coupling_switch)) return w;
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
