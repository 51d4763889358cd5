// The text of chart.py, which the command contains. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep::tool {

extern const char* const chart_script;

}  // namespace lockstep::tool
