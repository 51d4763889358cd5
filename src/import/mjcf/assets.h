// What <asset> has of one kind, by name. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>

#include "bodies.h"

namespace lockstep::importer::mjcf {

/// The name of an asset: without one of its own it has that of its file.
std::string name_of_asset(const Element::Xml& xml);

class Assets {
 public:
  /// `tag` is that of the elements, `words` what messages call one: "hfield", "height field".
  Assets(Document& document, const Classes& classes, std::string tag, std::string words)
      : document_(document), classes_(classes), tag_(std::move(tag)), words_(std::move(words)) {}

  /// The element that the geom names. Throws ImportError where there is none.
  Element find(const GeomPart& geom, const std::string& name);

 private:
  Document& document_;
  const Classes& classes_;
  std::string tag_, words_;
  std::optional<std::map<std::string, const Element::Xml*>> elements_;
};

}  // namespace lockstep::importer::mjcf
