// The rules for a Model, part by part. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "lockstep/model.h"

namespace lockstep {

/// Calls what judges one part, and says whether it threw nothing.
using Attempt = std::function<bool(const std::function<void()>& judge_part)>;

/// Judges all parts of a model in the order of Model::validate(), each by `attempt`. Where that lets no ModelError
/// through, what depends on a part that is refused is not judged.
void judge(const Model& model, const Attempt& attempt);

}  // namespace lockstep
