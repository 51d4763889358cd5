// Writes the kernels of the named plans of plans.h: make_kernels FOLDER NAME... SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include "plans.h"

int main(int argc, char** argv) {
  using namespace lockstep;
  for (int i = 2; i < argc; ++i) {
    const KernelSource source = generate_kernel(generated::plan_of(argv[i]), {.name = argv[i]});
    std::ofstream(std::string(argv[1]) + "/" + argv[i] + ".cpp") << source.code;
  }
}
