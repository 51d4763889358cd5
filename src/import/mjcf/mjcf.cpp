// MJCF text to Model: read() is the main path. SPDX-License-Identifier: Apache-2.0
#include "mjcf.h"

#include <filesystem>

#include "colliders.h"
#include "couple.h"
#include "drive.h"
#include "import/finish.h"
#include "import/options.h"
#include "import/xml.h"
#include "lockstep/import.h"
#include "loops.h"
#include "poses.h"
#include "resist.h"
#include "trees.h"

namespace lockstep {
namespace importer::mjcf {
namespace {

Import read(const std::string& text, const std::string& source, const std::string& folder,
            const ImportOptions& options) {
  refuse_others(options, Format::mjcf);
  Report report;
  Document document(text, source, folder, report);
  const Settings settings = read_settings(document);
  const Classes classes(document);
  const Scene scene = read_scene(document, settings, classes, options);
  const std::vector<Key> keys = read_keys(scene);
  const Start start = start_of(scene, keys);
  Draft draft;
  draft.model.name = Element(document, document.root()).name("model", "model");
  draft.model.time_step = settings.time_step;
  return finished(draft, options, report, source, [&] {
    const std::vector<Place> places = grow_trees(scene, start, draft);
    resist_by_time_constants(scene, draft);
    const Ties ties = couple(scene, draft);
    close_loops(scene, start, places, draft);
    const std::vector<std::optional<Transmission>> transmissions = transmissions_of_tendons(scene, ties, draft);
    resist_tendons(scene, ties, transmissions, draft);
    add_poses(scene, start, keys, drive_joints(scene, ties, transmissions, start, draft), draft);
    if (options.colliders)
      collide(scene, places, draft);
    else
      list_contacts(document);
    document.account();
  });
}

}  // namespace

Import read_file(const std::string& text, const std::string& path, const ImportOptions& options) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  return read(text, path, folder.empty() ? "." : folder.string(), options);
}

}  // namespace importer::mjcf

Import import_mjcf(const std::string& text, const std::string& source, const ImportOptions& options) {
  return importer::mjcf::read(text, source, "", options);
}

Import import_mjcf_file(const std::string& path, const ImportOptions& options) {
  return importer::mjcf::read_file(importer::text_of(path), path, options);
}

}  // namespace lockstep
