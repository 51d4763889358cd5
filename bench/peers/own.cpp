// This library as one of the peers, its methods side by side. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "lockstep/batch.h"
#include "peer.h"

namespace lockstep::peers {
namespace {

template <class S>
class OwnPeer : public Peer {
 public:
  OwnPeer(const Model& model, const StepSettings& settings, int environments, int steps, const BatchOptions& options)
      : batch_(compile(model, settings), environments, options), steps_(steps) {}

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

// What runs everywhere by default, or one instruction set, by tables or by generated code.
template <class S>
Contender contender(Method method, int steps, Target target = Target::avx2, bool generated = false) {
  if (!supported(target)) target = Target::automatic;
  const std::string words = method == Method::pgs ? "pgs 4" : name(method);
  const BatchOptions options{.threads = 1, .target = target, .generated = generated};
  return {.engine = "lockstep",
          .settings = fmt::format("{}, {}, {}, {}, {}", words, sizeof(S) == 4 ? "f32" : "f64", name(target),
                                  generated ? "generated" : "tables",
                                  steps == 1 ? "1 step per call" : fmt::format("{} steps per call", steps)),
          .steps_per_call = steps,
          .exact = method != Method::pgs,
          .make = [method, steps, options](const Model& model, double dt, int environments) {
            const StepSettings settings{.dt = dt, .method = method};
            return std::make_unique<OwnPeer<S>>(model, settings, environments, steps, options);
          }};
}

}  // namespace

std::vector<Contender> own_contenders() {
  std::vector<Contender> all;
  for (const int steps : {4, 1})
    for (const Method method : {Method::reduced, Method::direct, Method::pgs})
      all.push_back(contender<float>(method, steps));
  all.push_back(contender<double>(Method::reduced, 1));
  if (supported(Target::avx512)) all.push_back(contender<float>(Method::reduced, 4, Target::avx512));
#ifdef LOCKSTEP_BENCH_KERNELS
  for (const int steps : {4, 1}) all.push_back(contender<float>(Method::reduced, steps, Target::avx2, true));
  if (supported(Target::avx512)) all.push_back(contender<float>(Method::reduced, 4, Target::avx512, true));
#endif
  return all;
}

}  // namespace lockstep::peers
