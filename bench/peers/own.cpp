// This library as one of the peers, its methods side by side. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "lockstep/batch.h"
#include "peer.h"

namespace lockstep::peers {
namespace {

template <class S>
class OwnPeer : public Peer {
 public:
  OwnPeer(const Model& model, const StepSettings& settings, int environments, int steps)
      : batch_(compile(model, settings), environments, {.threads = 1}), steps_(steps) {}

  void reset() override { batch_.reset(); }
  void set_targets(const Eigen::VectorXd& targets) override {
    auto rows = batch_.position_targets();
    for (int dof = 0; dof < rows.rows(); ++dof) rows.row(dof) = static_cast<S>(targets[dof]);
  }
  void step() override { batch_.step(steps_); }
  Eigen::VectorXd positions() const override { return batch_.positions().col(0).matrix().template cast<double>(); }
  bool failed() const override { return batch_.faulted() > 0; }

 private:
  Batch<S> batch_;
  int steps_;
};

template <class S>
Contender contender(Method method, int steps) {
  const std::string words = method == Method::pgs ? "pgs 4" : name(method);
  return {.engine = "lockstep",
          .settings = fmt::format("{}, {}, {}", words, sizeof(S) == 4 ? "f32" : "f64",
                                  steps == 1 ? "1 step per call" : fmt::format("{} steps per call", steps)),
          .steps_per_call = steps,
          .exact = method != Method::pgs,
          .make = [method, steps](const Model& model, double dt, int environments) {
            const StepSettings settings{.dt = dt, .method = method};
            return std::make_unique<OwnPeer<S>>(model, settings, environments, steps);
          }};
}

}  // namespace

std::vector<Contender> own_contenders() {
  std::vector<Contender> all;
  for (const int steps : {4, 1})
    for (const Method method : {Method::reduced, Method::direct, Method::pgs})
      all.push_back(contender<float>(method, steps));
  all.push_back(contender<double>(Method::reduced, 1));
  return all;
}

}  // namespace lockstep::peers
