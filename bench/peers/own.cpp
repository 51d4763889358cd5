// This library as one of the peers: each method, one control per step or four steps per control. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "lockstep/batch.h"
#include "peer.h"

namespace lockstep::peers {
namespace {

class OwnPeer : public Peer {
 public:
  OwnPeer(const Model& model, const StepSettings& settings, int environments, int steps)
      : batch_(compile(model, settings), environments, {.threads = 1}), steps_(steps) {}

  void reset() override { batch_.reset(); }
  void set_targets(const Eigen::VectorXd& targets) override {
    auto rows = batch_.position_targets();
    for (int dof = 0; dof < rows.rows(); ++dof) rows.row(dof) = static_cast<float>(targets[dof]);
  }
  void step() override { batch_.step(steps_); }
  Eigen::VectorXd positions() const override { return batch_.positions().col(0).matrix().cast<double>(); }
  bool failed() const override { return batch_.faulted() > 0; }

 private:
  Batch<float> batch_;
  int steps_;
};

}  // namespace

std::vector<Contender> own_contenders() {
  std::vector<Contender> all;
  for (const int steps : {4, 1})
    for (const Method method : {Method::reduced, Method::direct, Method::pgs}) {
      const std::string words = method == Method::pgs ? "pgs 4" : name(method);
      all.push_back({.engine = "lockstep",
                     .settings = fmt::format("{}, f32, {} per call", words, steps == 1 ? "1 step" : "4 steps"),
                     .steps_per_call = steps,
                     .exact = method != Method::pgs,
                     .make = [method, steps](const Model& model, double dt, int environments) {
                       return std::make_unique<OwnPeer>(model, StepSettings{.dt = dt, .method = method}, environments,
                                                        steps);
                     }});
    }
  return all;
}

}  // namespace lockstep::peers
