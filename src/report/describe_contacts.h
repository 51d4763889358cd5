// The part of Plan::describe() about contacts. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "plan/program.h"

namespace lockstep {

/// Lines of text; empty for a model without contacts.
std::string contact_lines(const Program& program);

}  // namespace lockstep
