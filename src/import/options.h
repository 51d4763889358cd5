// Which options a format takes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/import.h"

namespace lockstep::importer {

enum class Format { urdf, mjcf };

/// Throws SettingsError for an option that is set and that the format cannot use.
void refuse_others(const ImportOptions& options, Format format);

}  // namespace lockstep::importer
