// Equalities as couplings. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "import/draft.h"
#include "scene.h"
#include "ties.h"

namespace lockstep::importer::mjcf {

/// Adds a coupling for each equality and each curve. A joint that an equality holds alone becomes fixed. Joints that
/// hard couplings tie start where these hold. Throws ImportError for equalities that contradict each other.
Ties couple(const Scene& scene, Draft& draft);

/// A Frequency that sags as the constraint does in MuJoCo.
Softness softness_of(const Yielding& yielding);

/// The form as a coupling of at least two joints.
Coupling coupling_of(const Form& form, const Scene& scene, const Softness& softness);

}  // namespace lockstep::importer::mjcf
