// Texts of MJCF, with their colliders and meshes of vertices. The last byte chooses options, so that files are seeds.
// SPDX-License-Identifier: Apache-2.0
#include "fuzz.h"

using namespace lockstep;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data), size - 1);
  const std::uint8_t chosen = data[size - 1];
  ImportOptions options;
  options.colliders = chosen & 1, options.repair_inertias = chosen & 2, options.leave_out_meshes = chosen & 4;
  if (chosen & 8) options.soft = Soft::as_in_file;
  if (chosen & 16) options.loops = Loops::leave_out;
  if (chosen & 32) options.fit = Fit::box;
  if (chosen & 64) options.keyframe = "0";
  fuzz::taken([&] {
    const Import read = import_mjcf(text, "input", options);
    if (fuzz::one_in(256, text)) fuzz::use(read.model);
  });
  return 0;
}
