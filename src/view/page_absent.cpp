// Stands for the page in a command without the viewer. SPDX-License-Identifier: Apache-2.0
#include "page.h"

namespace lockstep::view {

const std::string_view page_template;

}  // namespace lockstep::view
