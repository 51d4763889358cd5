// The environment variable LOCKSTEP_TEST_ENGINE. SPDX-License-Identifier: Apache-2.0
//
// Set to tables or compiled, it is the engine that batches of this program choose by default, if it takes the plan.
#include "batch/engine.h"

#include <cstdlib>
#include <stdexcept>
#include <string>

#include "contract.h"

namespace lockstep::contract {
namespace {

bool prefer() {
  const char* variable = std::getenv("LOCKSTEP_TEST_ENGINE");
  if (!variable) return false;
  for (Engine engine : {Engine::tables, Engine::compiled})
    if (std::string(variable) == to_string(engine)) return prefer_engine(engine), true;
  throw std::invalid_argument(std::string("LOCKSTEP_TEST_ENGINE must be tables or compiled, not ") + variable);
}

}  // namespace

const bool engine_preferred = prefer();

}  // namespace lockstep::contract
