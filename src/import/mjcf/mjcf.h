// MJCF text of a file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/import.h"

namespace lockstep::importer::mjcf {

/// import_mjcf_file() with the content of the file.
Import read_file(const std::string& text, const std::string& path, const ImportOptions& options);

}  // namespace lockstep::importer::mjcf
