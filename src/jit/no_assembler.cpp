// In place of make.cpp where there is no assembler. SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace lockstep::jit {

std::string build_obstacle() { return "this library was built without its assembler"; }
CompiledStep make(const trace::TracedStep&, int, const TilePlaces&) { return {}; }
CompiledStep make(const trace::TracedRoutines&, int, const TilePlaces&) { return {}; }
std::string print_step(const trace::TracedStep&, int, const TilePlaces&) { return ""; }
std::string print_routines(const trace::TracedRoutines&, int, const TilePlaces&) { return ""; }

}  // namespace lockstep::jit
