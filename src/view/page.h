// A motion as one HTML file, which plays it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "motion.h"

namespace lockstep::view {

/// The page without a motion, made of src/view/viewer and npm's libraries; empty in a build without the viewer.
extern const std::string_view page_template;

/// Throws UsageError where this build has no viewer.
void require_viewer();

/// The samples of a motion: 32-bit floats, little-endian, in base64. First the times; then by environment the poses and
/// pushes of its Track, and [samples] for each of its curves.
std::string motion_numbers(const Motion& motion);

/// The motion as JSON: names, units, roles, solids, meshes, and its motion_numbers() as `numbers`. The 32-bit floats
/// and integers of meshes are written likewise. No text in it ends a script element. `about` and `notes` are shown as
/// they are.
std::string motion_json(const Motion& motion, const std::string& about, const std::vector<std::string>& notes);

/// What the page does not show of the motion, and why.
std::vector<std::string> notes_on(const Motion& motion);

/// The page with the motion in it.
std::string page_of(const Motion& motion, const std::string& about, const std::vector<std::string>& notes);

/// RFC 4648, section 4.
std::string base64(std::span<const unsigned char> bytes);

}  // namespace lockstep::view
