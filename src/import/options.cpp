// Options of one format for files of another. SPDX-License-Identifier: Apache-2.0
#include "options.h"

#include "lockstep/error.h"

namespace lockstep {

const char* to_string(Loops loops) { return loops == Loops::keep ? "keep" : "leave_out"; }
const char* to_string(Fit fit) {
  constexpr const char* names[] = {"hull", "box", "capsule", "none"};
  return names[static_cast<int>(fit)];
}
const char* to_string(Soft soft) { return soft == Soft::harden ? "harden" : "as_in_file"; }

}  // namespace lockstep

namespace lockstep::importer {

void refuse_others(const ImportOptions& options, Format format) {
  const auto refuse = [&](bool is_set, Format used, const char* name, const char* remedy) {
    if (is_set && used != format)
      throw SettingsError(std::string("ImportOptions::") + name,
                          format == Format::urdf ? "is set for URDF, which has no use for it"
                                                 : "is set for MJCF, which has no use for it",
                          remedy);
  };
  const char* const mjcf_only = "leave it out, it is for MJCF";
  refuse(!options.keyframe.empty(), Format::mjcf, "keyframe", mjcf_only);
  refuse(!options.body.empty(), Format::mjcf, "body", mjcf_only);
  refuse(options.loops != Loops::keep, Format::mjcf, "loops", "use leave_out_foreign, loops are no URDF");
  refuse(!options.self_collisions, Format::mjcf, "self_collisions", "leave it out, URDF declares no pairs");
  refuse(options.soft != Soft::harden, Format::mjcf, "soft", mjcf_only);
  refuse(options.density != 0.0, Format::urdf, "density", "leave it out, MJCF's geoms have densities of their own");
  refuse(options.leave_out_foreign, Format::urdf, "leave_out_foreign", "use loops, MJCF's own elements are no others'");
}

}  // namespace lockstep::importer
