// URDF from text that is already loaded. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/import.h"

namespace lockstep::importer::urdf {

/// `folder` is that of the file, where its meshes are; empty for text.
Import read(const std::string& text, const std::string& source, const std::string& folder,
            const ImportOptions& options);

}  // namespace lockstep::importer::urdf
