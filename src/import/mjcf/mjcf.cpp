// MJCF text to Model: read() is the main path. SPDX-License-Identifier: Apache-2.0
#include "mjcf.h"

#include "colliders.h"
#include "couple.h"
#include "drive.h"
#include "import/finish.h"
#include "import/folders.h"
#include "import/options.h"
#include "import/paths.h"
#include "import/xml.h"
#include "lockstep/import.h"
#include "loops.h"
#include "poses.h"
#include "resist.h"
#include "trees.h"
#include "visuals.h"

namespace lockstep {
namespace importer::mjcf {

Import read(const std::string& text, const std::string& source, const std::string& folder,
            const ImportOptions& options) {
  refuse_others(options, Format::mjcf);
  Report report;
  Document document(text, source, folder, roots_of(options, folder), report);
  const Settings settings = read_settings(document);
  const Classes classes(document);
  MeshFiles files(options, folder, report);
  Meshes meshes(document, settings, classes, files);
  const Scene scene = read_scene(document, settings, classes, options, meshes);
  const std::vector<Key> keys = read_keys(scene);
  const Start start = start_of(scene, keys);
  Draft draft;
  draft.format = Format::mjcf;
  draft.model.name = Element(document, document.root()).name("model", "model");
  draft.model.time_step = settings.time_step;
  return finished(draft, options, report, source, [&] {
    const std::vector<Place> places = grow_trees(scene, start, draft);
    resist_by_time_constants(scene, draft);
    const Ties ties = couple(scene, draft);
    close_loops(scene, start, places, draft);
    const Ends ends(scene, start, places);
    const std::vector<std::optional<Transmission>> transmissions = transmissions_of_tendons(scene, ties, ends, draft);
    resist_tendons(scene, ties, transmissions, draft);
    add_poses(scene, start, keys, drive_joints(scene, ties, transmissions, start, draft), draft);
    if (options.colliders)
      collide(scene, places, draft);
    else
      list_contacts(document);
    if (options.visual_meshes) look(scene, places, draft);
    document.account();
  });
}

}  // namespace importer::mjcf

Import import_mjcf(const std::string& text, const std::string& source, const ImportOptions& options) {
  return importer::mjcf::read(text, source, "", options);
}

Import import_mjcf_file(const std::string& path, const ImportOptions& options) {
  return importer::mjcf::read(importer::text_of(path), path, importer::folder_of(path), options);
}

}  // namespace lockstep
