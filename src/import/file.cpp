// A file by its root element. SPDX-License-Identifier: Apache-2.0
#include <string_view>

#include "lockstep/import.h"
#include "mjcf/mjcf.h"
#include "paths.h"
#include "urdf/urdf.h"
#include "xml.h"

namespace lockstep {

Import import_file(const std::string& path, const ImportOptions& options) {
  const std::string text = importer::text_of(path);
  bool is_mjcf = false;
  {
    tinyxml2::XMLDocument document(/*processEntities=*/false);
    importer::Report ignored;  // the reader of the format warns of the same
    const std::string_view root =
        importer::parsed(text, path, "a URDF or MJCF file, <robot name=\"...\"> or <mujoco>", document, ignored).Name();
    is_mjcf = root == "mujoco" || root == "mujocoinclude";
  }
  return is_mjcf ? importer::mjcf::read(text, path, importer::folder_of(path), options)
                 : importer::urdf::read(text, path, importer::folder_of(path), options);
}

}  // namespace lockstep
