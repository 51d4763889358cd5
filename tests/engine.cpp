// LOCKSTEP_TEST_ENGINE, set to tables or interpreter: the engine that batches of this program take by themselves, where
// it takes the plan. SPDX-License-Identifier: Apache-2.0
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
  for (Engine engine : {Engine::tables, Engine::interpreter})
    if (std::string(variable) == to_string(engine)) return prefer_engine(engine), true;
  throw std::invalid_argument(std::string("LOCKSTEP_TEST_ENGINE is ") + variable);
}

}  // namespace

const bool engine_preferred = prefer();

}  // namespace lockstep::contract
