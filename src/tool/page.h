// The page of `lockstep view`: a motion as one HTML file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "motion.h"

namespace lockstep::tool {

/// The page without a motion, made of src/tool/viewer and npm's libraries; empty in a command without the viewer.
extern const std::string_view page_template;

/// Throws InputError where this command has no viewer.
void require_viewer();

/// The motion as JSON. Beside names, units, roles and solids it has `numbers`: 32-bit floats, little-endian, in base64.
/// First `samples` times; then by environment the poses and pushes of its Track, and [samples] for each of its curves.
/// No text in it ends a script element. `about` and `notes` are shown as they are.
std::string motion_json(const Motion& motion, const std::string& about, const std::vector<std::string>& notes);

/// The page with the motion in it.
std::string page_of(const Motion& motion, const std::string& about, const std::vector<std::string>& notes);

/// RFC 4648, section 4.
std::string base64(std::span<const unsigned char> bytes);

}  // namespace lockstep::tool
