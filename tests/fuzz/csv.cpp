// Recordings and other tables as text. SPDX-License-Identifier: Apache-2.0
#include "tool/csv.h"
#include "fuzz.h"
#include "tool/replay.h"
#include "tool/tool.h"

using namespace lockstep;

namespace {

Plan pendulum() {
  Model model;
  model.links = {{"base", {}}, {"rod", {1.0, {0.1, 0.0, 0.0}, 0.01 * Eigen::Matrix3d::Identity()}}};
  model.joints.push_back({"pin", JointKind::revolute, "base", "rod"});
  return compile(model);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Plan plan = pendulum();
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    tool::Table table = tool::parse_csv(text, "input");
    fuzz::taken([&] {
      const tool::Recording recording = tool::recording_of(std::move(table), plan);
      if (recording.times.size() <= 100) tool::replay({recording}, plan, {}, 30.0, 1);
    });
  } catch (const tool::InputError&) {
  }
  return 0;
}
