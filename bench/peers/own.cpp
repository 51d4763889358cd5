// This library as a peer, with its methods and integrators. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "loads.h"
#include "lockstep/batch.h"
#include "peer.h"

namespace lockstep::peers {
namespace {

template <class S>
class OwnPeer : public Peer {
 public:
  OwnPeer(const Model& model, const StepSettings& settings, int environments, int steps, const BatchOptions& options)
      : OwnPeer(compile(model, settings), environments, steps, options) {}

  void reset() override { batch_.reset(EnvironmentSet::all(), {.keep_inputs = true}); }
  void set_targets(const Eigen::VectorXd& targets) override {
    auto rows = batch_.position_targets();
    for (int dof = 0; dof < rows.rows(); ++dof) rows.row(dof) = static_cast<S>(targets[dof]);
  }
  std::vector<double> target_times() const override {
    return batch_.plan().settings().stage_inputs ? batch_.plan().stage_times() : std::vector<double>{0.0};
  }
  void set_targets_at(int time, const Eigen::VectorXd& targets) override {
    auto rows = batch_.position_targets();
    const auto first = time * targets.size();
    for (Eigen::Index dof = 0; dof < targets.size(); ++dof) rows.row(first + dof) = static_cast<S>(targets[dof]);
  }
  std::optional<reference::State> state() const override {
    reference::State state = reference::Mechanism(batch_.plan().model()).initial_state();
    state.q = positions();
    state.v.tail(state.q.size()) = batch_.velocities().col(0).matrix().template cast<double>();
    if (batch_.root_poses().rows() == 0) return state;
    const Eigen::VectorXd pose = batch_.root_poses().col(0).matrix().template cast<double>();
    state.roots[0] = {pose.head<3>(), Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6])};
    state.v.head(6) = batch_.root_velocities().col(0).matrix().template cast<double>();
    return state;
  }
  void step() override { batch_.step(steps_); }
  Eigen::VectorXd positions() const override { return batch_.positions().col(0).matrix().template cast<double>(); }
  bool failed() const override { return batch_.faulted() > 0; }

 private:
  OwnPeer(const Plan& plan, int environments, int steps, BatchOptions options)
      : batch_(plan, environments, (options.engine = bench::engine_of(plan, options.engine), options)), steps_(steps) {}

  Batch<S> batch_;
  int steps_;
};

// A method by the automatic engine or by generated code. Each step is taken in `parts` parts.
template <class S>
Contender contender(Method method, int steps, Target target = Target::avx2, bool generated = false,
                    Integrator integrator = Integrator::euler, int parts = 1) {
  if (!supported(target)) target = Target::automatic;
  const std::string words = integrator != Integrator::euler ? to_string(integrator)
                            : method == Method::pgs         ? "pgs 4"
                                                            : to_string(method);
  const BatchOptions options{
      .threads = 1, .target = target, .engine = generated ? Engine::generated : Engine::automatic};
  return {.engine = "lockstep",
          .settings = fmt::format("{}, {}, {}, {}{}{}", words, sizeof(S) == 4 ? "f32" : "f64", to_string(target),
                                  generated ? "generated, " : "",
                                  steps == 1 ? "1 step per call" : fmt::format("{} steps per call", steps),
                                  parts == 1 ? "" : fmt::format(" in {} parts each", parts)),
          .steps_per_call = steps,
          .exact = method != Method::pgs,
          .environments = 256,
          .make = [=](const Model& model, double dt, int environments) {
            const StepSettings settings{.dt = dt / parts, .method = method, .integrator = integrator};
            return std::make_unique<OwnPeer<S>>(model, settings, environments, steps * parts, options);
          }};
}

// An integrator with targets for the time of each stage, or a method of Euler's steps.
template <class S>
Contender integrated(Integrator integrator, Method method = Method::automatic, int iterations = 4) {
  const Target target = supported(Target::avx2) ? Target::avx2 : Target::automatic;
  const bool sweeps = method == Method::pgs || method == Method::tgs;
  const std::string words = method == Method::automatic ? to_string(integrator)
                            : sweeps                    ? fmt::format("{} {}", to_string(method), iterations)
                                                        : to_string(method);
  return {.engine = "lockstep",
          .settings = fmt::format("{}, {}", words, sizeof(S) == 4 ? "f32" : "f64"),
          .exact = !sweeps,
          .environments = 1024,
          .make = [=](const Model& model, double dt, int environments) {
            const StepSettings settings{.dt = dt,
                                        .method = method,
                                        .integrator = integrator,
                                        .iterations = iterations,
                                        .stage_inputs = integrator != Integrator::euler};
            return std::make_unique<OwnPeer<S>>(model, settings, environments, 1,
                                                BatchOptions{.threads = 1, .target = target, .engine = Engine::tables});
          }};
}

}  // namespace

std::vector<Contender> own_integrators() {
  std::vector<Contender> all;
  for (const Integrator integrator :
       {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta}) {
    all.push_back(integrated<float>(integrator));
    all.push_back(integrated<double>(integrator));
  }
  all.push_back(integrated<float>(Integrator::euler, Method::direct));
  for (const Method method : {Method::pgs, Method::tgs})
    for (const int iterations : {4, 16}) all.push_back(integrated<float>(Integrator::euler, method, iterations));
  return all;
}

std::vector<Contender> own_contenders() {
  std::vector<Contender> all;
  for (const int steps : {4, 1})
    for (const Method method : {Method::reduced, Method::direct, Method::pgs})
      all.push_back(contender<float>(method, steps));
  all.push_back(contender<double>(Method::reduced, 1));
  if (supported(Target::avx512)) all.push_back(contender<float>(Method::reduced, 4, Target::avx512));
#ifdef LOCKSTEP_BENCH_KERNELS
  for (const int steps : {4, 1}) all.push_back(contender<float>(Method::reduced, steps, Target::avx2, true));
  all.push_back(contender<float>(Method::reduced, 4, Target::avx2, true, Integrator::euler, 2));
  all.push_back(contender<float>(Method::reduced, 4, Target::avx2, true, Integrator::leapfrog));
  if (supported(Target::avx512)) all.push_back(contender<float>(Method::reduced, 4, Target::avx512, true));
#endif
  return all;
}

}  // namespace lockstep::peers
