// Texts of URDF. The last byte chooses options, so that files are seeds. SPDX-License-Identifier: Apache-2.0
#include "fuzz.h"

using namespace lockstep;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data), size - 1);
  const std::uint8_t chosen = data[size - 1];
  ImportOptions options;
  options.colliders = chosen & 1, options.repair_inertias = chosen & 2, options.leave_out_foreign = chosen & 4;
  if (chosen & 8) options.density = 1000.0;
  if (chosen & 16) options.least_mass = options.least_inertia = 1e-6;
  fuzz::taken([&] {
    const Import read = import_urdf(text, "input", options);
    if (fuzz::one_in(256, text)) fuzz::use(read.model);
  });
  return 0;
}
