// What an application does with the installed library. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <cmath>
#include <cstdio>
#include <string>

namespace {

// Two equal bars in a row, the second turning back twice as far as the first turns: the tip stays on a line.
lockstep::Model linkage() {
  lockstep::Model model;
  const auto bar = lockstep::Inertia::box(1.0, {0.3, 0.02, 0.02}, {0.15, 0.0, 0.0});
  model.links = {{"base", {}}, {"upper", bar}, {"lower", bar}};
  lockstep::Joint shoulder;
  shoulder.name = "shoulder";
  shoulder.kind = lockstep::JointKind::revolute;
  shoulder.parent = "base";
  shoulder.child = "upper";
  shoulder.axis = Eigen::Vector3d::UnitY();
  lockstep::Joint elbow = shoulder;
  elbow.name = "elbow";
  elbow.parent = "upper";
  elbow.child = "lower";
  elbow.origin.translation() = Eigen::Vector3d(0.3, 0.0, 0.0);
  model.joints = {shoulder, elbow};
  model.couplings = {lockstep::Coupling::mimic("elbow", "shoulder", 2.0)};
  model.sites = {{"tip", "lower", Eigen::Isometry3d(Eigen::Translation3d(0.3, 0.0, 0.0))}};
  return model;
}

}  // namespace

int main() {
  const std::string expected = EXPECTED_VERSION;
  if (!expected.empty() && expected != lockstep::version()) {
    std::printf("the package says %s, the library %s\n", expected.c_str(), lockstep::version());
    return 1;
  }
  const lockstep::Plan from_file = lockstep::compile(lockstep::import_urdf_file(LINKAGE).model, {.dt = 1.0 / 240});
  const std::string kernel = lockstep::Batch<float>(from_file, 1).kernel_name();
  if (kernel != "linkage") {
    std::printf("the kernel is '%s', not the one that was generated\n%s", kernel.c_str(), from_file.describe().c_str());
    return 1;
  }
  const lockstep::Plan plan = lockstep::compile(linkage(), {.dt = 1.0 / 240});
  lockstep::Batch<float> batch(plan, 1000);
  batch.step(60);
  const auto errors = batch.coupling_errors();
  const auto tips = batch.site_positions(plan.site("tip"));
  const bool good = batch.faulted() == 0 && errors.abs().maxCoeff() < 1e-5f && tips.row(2).abs().maxCoeff() < 1e-5f &&
                    tips.row(0).maxCoeff() < 0.59f;
  std::printf("%s%d environments, |C| %.1e, tip at x = %.3f m\n", plan.describe().c_str(), batch.environments(),
              static_cast<double>(errors.abs().maxCoeff()), static_cast<double>(tips(0, 0)));
  return good ? 0 : 1;
}
