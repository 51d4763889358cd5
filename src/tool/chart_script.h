// chart.py, as it stands in this folder, carried inside the command. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep::tool {

extern const char* const chart_script;

}  // namespace lockstep::tool
