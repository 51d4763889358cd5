// MJCF from text that is already loaded. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/import.h"

namespace lockstep::importer::mjcf {

/// `folder` is that of the file, where those that it includes and its meshes are; empty for text.
Import read(const std::string& text, const std::string& source, const std::string& folder,
            const ImportOptions& options);

}  // namespace lockstep::importer::mjcf
