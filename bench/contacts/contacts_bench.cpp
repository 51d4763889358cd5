// What contacts cost and how well they hold, in the scenes of tests/contact_scenes.h. SPDX-License-Identifier:
// Apache-2.0
//
//   contacts_bench [f32|f64] [environments] [hertz] [euler|leapfrog]
//
// One JSON line a scene: processor time of a step of one environment (ns; minimum and median of 15 stretches of the
// motion, one thread), and the scene's error as peer.mjs measures it. Environments do the same at the same time.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "contact_scenes.h"
#include "cpu_seconds.h"

using namespace lockstep;
using namespace lockstep::contact_scenes;
using lockstep::bench::cpu_seconds;

namespace {

Integrator integrator = Integrator::euler;

/// Steps a scene and times stretches of it. `inputs` sets targets for the time t; `look` measures after a step.
template <class S>
struct Run {
  Run(const char* name, const Model& model, int environments, int hertz)
      : name(name),
        hertz(hertz),
        plan(compile(model, {.dt = 1.0 / hertz, .integrator = integrator})),
        batch(plan, environments, {.threads = 1}) {}

  template <class Inputs, class Look>
  void go(double duration, Inputs&& inputs, Look&& look) {
    const int steps = static_cast<int>(duration * hertz), stretch = std::max(1, steps / 15);
    double spent = 0.0;
    for (int i = 0; i < steps; ++i) {
      const double t = (i + 1.0) / hertz;
      inputs(t);
      const double begin = cpu_seconds();
      batch.step(1);
      spent += cpu_seconds() - begin;
      look(t);
      if (i % stretch != stretch - 1) continue;
      nanoseconds.push_back(1e9 * spent / stretch / batch.environments());
      spent = 0.0;
    }
  }

  template <class... Number>
  void print(const char* fields, Number... numbers) {
    std::sort(nanoseconds.begin(), nanoseconds.end());
    int faults = 0;
    for (const Fault fault : batch.faults()) faults += fault != Fault::none;
    std::printf(
        "{\"scene\": \"%s\", \"precision\": \"f%zu\", \"target\": \"%s\", \"environments\": %d, \"hertz\": %d, ", name,
        8 * sizeof(S), to_string(batch.target()), batch.environments(), hertz);
    std::printf("\"ns_min\": %.1f, \"ns_median\": %.1f, \"unfinished\": %g, \"faults\": %d, ", nanoseconds.front(),
                nanoseconds[nanoseconds.size() / 2], read(Quantity::unfinished_contacts).sum(), faults);
    std::printf(fields, numbers...);
    std::printf("}\n");
    std::fflush(stdout);
  }

  /// Of the first environment.
  Eigen::ArrayXd read(Quantity quantity) {
    const Query query{quantity};
    typename Batch<S>::Array numbers(plan.query_rows(query), batch.environments());
    batch.read(std::span(&query, 1), {numbers.data(), batch.environments(), 1});
    return numbers.col(0).template cast<double>();
  }
  double pose(int row) const { return static_cast<double>(batch.root_poses()(row, 0)); }

  const char* name;
  int hertz;
  Plan plan;
  Batch<S> batch;
  std::vector<double> nanoseconds;
};

template <class S>
void grasp(double mass, int environments, int hertz) {
  const Grasp scene{mass};
  const std::string name = "grasp " + std::to_string(mass).substr(0, 5);
  Run<S> run(name.c_str(), scene.model(), environments, hertz);
  const int rows[] = {run.plan.dof("y"), run.plan.dof("z"), run.plan.dof("wrist"), run.plan.dof("left")};
  Eigen::Isometry3d first = Eigen::Isometry3d::Identity();
  bool kept = false;
  double slip = 0.0, turn = 0.0, deepest = 0.0;
  run.go(
      11.0,
      [&](double t) {
        const Eigen::Vector4d targets = scene.targets(t);
        for (int k = 0; k < 4; ++k) run.batch.position_targets().row(rows[k]) = static_cast<S>(targets[k]);
      },
      [&](double t) {
        if (t < 1.0) return;
        const Eigen::ArrayXd q = run.batch.positions().col(0).template cast<double>();
        Eigen::Isometry3d palm = Eigen::Isometry3d::Identity(), object = palm;
        palm.translation() = Eigen::Vector3d(0, q[rows[0]], 0.03 + q[rows[1]]);
        palm.linear() = Eigen::AngleAxisd(q[rows[2]], Eigen::Vector3d::UnitZ()).toRotationMatrix();
        object.translation() = Eigen::Vector3d(run.pose(0), run.pose(1), run.pose(2));
        object.linear() =
            Eigen::Quaterniond(run.pose(3), run.pose(4), run.pose(5), run.pose(6)).normalized().toRotationMatrix();
        const Eigen::Isometry3d seen = palm.inverse() * object;
        if (!kept) first = seen, kept = true;
        slip = std::max(slip, (seen.translation() - first.translation()).norm());
        turn = std::max(turn, Eigen::AngleAxisd(first.linear().transpose() * seen.linear()).angle());
        deepest = std::max(deepest, q[rows[3]] - 0.03);
      });
  run.print("\"slip\": %.3g, \"turn\": %.3g, \"penetration\": %.3g, \"coupling_error\": %.3g", slip, turn, deepest,
            static_cast<double>(run.batch.coupling_errors().abs().maxCoeff()));
}

template <class S>
void stacks(double top, int environments, int hertz) {
  const std::string name = "stack " + std::to_string(static_cast<int>(top));
  Run<S> run(name.c_str(), stack(top), environments, hertz);
  double fastest = 0.0, deepest = 0.0;
  run.go(
      12.0, [](double) {},
      [&](double t) {
        if (t < 2.0) return;
        fastest = std::max(fastest, static_cast<double>(run.batch.root_velocities().col(0).abs().maxCoeff()));
        deepest = std::max(deepest, -run.read(Quantity::contact_gap).minCoeff());
      });
  run.print("\"speed\": %.3g, \"penetration\": %.3g", fastest, deepest);
}

template <class S>
void walker(bool trots, int environments, int hertz) {
  Run<S> run(trots ? "quadruped trots" : "quadruped stands", quadruped(), environments, hertz);
  int hips[4], k = 0;
  for (const char* hip : {"fl_hip", "fr_hip", "hl_hip", "hr_hip"}) hips[k++] = run.plan.dof(hip);
  double fastest = 0.0, deepest = 0.0;
  run.go(
      10.0,
      [&](double t) {
        const Eigen::Vector4d targets = trot(t);
        for (int i = 0; trots && i < 4; ++i) run.batch.position_targets().row(hips[i]) = static_cast<S>(targets[i]);
      },
      [&](double t) {
        if (t < 3.0) return;
        fastest = std::max(fastest, static_cast<double>(run.batch.root_velocities().col(0).abs().maxCoeff()));
        deepest = std::max(deepest, -run.read(Quantity::contact_gap).minCoeff());
      });
  run.print("\"speed\": %.3g, \"penetration\": %.3g, \"coupling_error\": %.3g", fastest, deepest,
            static_cast<double>(run.batch.coupling_errors().abs().maxCoeff()));
}

template <class S>
void slides(int environments, int hertz) {
  Model model = block();
  model.roots[0].velocity << 0, 0, 0, 3, 0, 0;
  Run<S> run("slide", model, environments, hertz);
  double highest = 0.0, lowest = 0.0;
  run.go(
      2.0, [](double) {},
      [&](double) { highest = std::max(highest, run.pose(2) - 0.05), lowest = std::min(lowest, run.pose(2) - 0.05); });
  const double way = 9.0 / (2 * 0.5 * 9.81);
  run.print("\"highest\": %.3g, \"penetration\": %.3g, \"way\": %.5g, \"way_error\": %.3g", highest, -lowest,
            run.pose(0), std::abs(run.pose(0) / way - 1.0));
}

template <class S>
void slopes(double share, int environments, int hertz) {
  Run<S> run(share < 1.0 ? "slope 0.99" : "slope 1.01", slope(share), environments, hertz);
  double start = 0.0;
  run.go(
      5.0, [](double) {},
      [&](double t) {
        if (t <= 1.0) start = run.pose(0);
      });
  const double angle = share * std::atan(0.5), ideal = 9.81 * (std::sin(angle) - 0.5 * std::cos(angle)) * 5.0;
  run.print("\"moved\": %.3g, \"speed\": %.6g, \"ideal\": %.6g", run.pose(0) - start,
            static_cast<double>(run.batch.root_velocities()(3, 0)), ideal);
}

template <class S>
void all(int environments, int hertz) {
  for (const double mass : {0.001, 0.1, 1.0, 10.0}) grasp<S>(mass, environments, hertz);
  for (const double top : {1.0, 10.0, 100.0}) stacks<S>(top, environments, hertz);
  for (const bool trots : {false, true}) walker<S>(trots, environments, hertz);
  slides<S>(environments, hertz);
  for (const double share : {0.99, 1.01}) slopes<S>(share, environments, hertz);
}

}  // namespace

int main(int count, char** arguments) {
  const bool twice = count > 1 && std::string(arguments[1]) == "f64";
  const int environments = count > 2 ? std::atoi(arguments[2]) : 256, hertz = count > 3 ? std::atoi(arguments[3]) : 240;
  const std::string steps_by = count > 4 ? arguments[4] : "euler";
  if (environments < 1 || hertz < 1 || (steps_by != "euler" && steps_by != "leapfrog")) {
    std::fprintf(stderr, "contacts_bench [f32|f64] [environments] [hertz] [euler|leapfrog]\n");
    return 2;
  }
  if (steps_by == "leapfrog") integrator = Integrator::leapfrog;
  twice ? all<double>(environments, hertz) : all<float>(environments, hertz);
}
