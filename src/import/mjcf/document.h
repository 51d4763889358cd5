// An MJCF file with all that it includes and attaches. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tinyxml2.h>

#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "import/attributes.h"
#include "import/report.h"

namespace lockstep::importer::mjcf {

/// A model of its own with all that it includes: the main file, or what an <attach> brings.
struct Part {
  const tinyxml2::XMLElement* root = nullptr;
  std::string prefix = {};                     ///< of all names in it, which have it already
  std::filesystem::path folder = {};           ///< of its file; empty for text
  const tinyxml2::XMLElement* body = nullptr;  ///< all that an <attach> takes of it; null: its whole world
  std::string childclass = {};                 ///< of that body, by what stands around it
};

/// Elements in the order that they have once each <include> has made way for the content of its file. It notes what is
/// read, so that account() can report all else.
class Document {
 public:
  using Xml = tinyxml2::XMLElement;

  /// `folder` is that of the file, empty if the text has no folder; other files may lie in the `roots`. Throws
  /// ImportError for a file that cannot be included or attached: it lies elsewhere, appears twice, or is no MJCF.
  Document(const std::string& text, const std::string& source, const std::string& folder,
           std::vector<std::filesystem::path> roots, Report& report);

  const Xml& root() const { return *parts_[0].root; }
  Report& report() { return report_; }

  /// The main file first, then what is attached, in order.
  const std::deque<Part>& parts() const { return parts_; }
  std::size_t part_of(const Xml& xml) const;  ///< its number
  const Part& attached_by(const Xml& attach) const { return parts_[attached_.at(&attach)]; }

  /// Child elements, those of included files among them.
  std::vector<const Xml*> children(const Xml& owner) const;
  /// What stands in the sections of this tag of all parts, in order.
  std::vector<const Xml*> inside(std::string_view tag) const;
  /// The same; the sections are visited.
  std::vector<const Xml*> section(std::string_view tag);
  std::string line(const Xml& xml) const;  ///< "file:line"

  void visit(const Xml& xml) { visited_.insert(&xml); }  ///< its attributes and children are looked at one by one
  void note_read(const tinyxml2::XMLAttribute& attribute) { read_.insert(&attribute); }

  /// Tells the report of all elements that were not visited and all attributes that were not read.
  void account();

 private:
  struct Source;

  const Source& load(const std::string& text, const std::string& name, const std::filesystem::path& path,
                     std::size_t part);
  /// The file that an element names, by its real path. Calls `refuse` where there is none that may be read.
  std::filesystem::path find(const std::string& name, const Xml& element, const Fail& refuse) const;
  const Source& read(const std::filesystem::path& path, std::size_t part, const Fail& refuse);
  void include_all(const Source& from, int depth);
  void include(const Xml& element, const Source& from, int depth);
  // What attach.cpp has.
  void attach_all(std::size_t part, int depth);
  void attach(const Xml& element, int depth);
  const Source& load_attached(const Xml& element, const std::string& model, const Fail& refuse);
  void add_prefix(std::size_t part);
  void choose_body(Part& part, const std::string& name, const Fail& refuse);

  void account(const Xml& element, std::string_view owner);

  std::vector<std::filesystem::path> roots_;
  Report& report_;
  std::deque<Part> parts_;
  std::vector<std::shared_ptr<Source>> sources_;
  std::unordered_map<const Xml*, const Source*> included_;  // by <include>
  std::unordered_map<const Xml*, std::size_t> attached_;    // parts by <attach>
  std::size_t bytes_ = 0;
  std::unordered_set<const void*> visited_, read_;
};

struct Document::Source {
  std::string name;
  std::filesystem::path path;  // canonical; empty for text
  std::size_t part;
  tinyxml2::XMLDocument xml{/*processEntities=*/false};
  Xml* root = nullptr;
};

}  // namespace lockstep::importer::mjcf
