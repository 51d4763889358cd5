// An MJCF file with all that it includes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tinyxml2.h>

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "import/report.h"

namespace lockstep::importer::mjcf {

/// Elements in the order that they have once each <include> has made way for the content of its file. It notes what is
/// read, so that account() can report all else.
class Document {
 public:
  using Xml = tinyxml2::XMLElement;

  /// `folder` is that of the file; empty if the text has no folder. Throws ImportError for a file that cannot be
  /// included: it lies outside of the folder, appears twice, or is no MJCF.
  Document(const std::string& text, const std::string& source, const std::string& folder, Report& report);

  const Xml& root() const { return *root_; }
  Report& report() { return report_; }

  /// Child elements, those of included files among them.
  std::vector<const Xml*> children(const Xml& owner) const;
  /// What stands in the root's sections of this tag, in order. The sections are visited.
  std::vector<const Xml*> section(std::string_view tag);
  std::string line(const Xml& xml) const;  ///< "file:line"

  void visit(const Xml& xml) { visited_.insert(&xml); }  ///< its attributes and children are looked at one by one
  void note_read(const tinyxml2::XMLAttribute& attribute) { read_.insert(&attribute); }

  /// Tells the report of all elements that were not visited and all attributes that were not read.
  void account();

 private:
  struct Source;

  void include_all(const Source& from, int depth);
  void include(const Xml& element, const Source& from, int depth);
  const Source& load(const std::string& text, const std::string& name, const std::filesystem::path& path);
  void account(const Xml& element);

  std::filesystem::path folder_;
  Report& report_;
  std::vector<std::shared_ptr<Source>> sources_;
  std::map<const Xml*, const Source*> included_;  // by <include>
  const Xml* root_ = nullptr;
  std::size_t bytes_ = 0;
  std::unordered_set<const void*> visited_, read_;
};

}  // namespace lockstep::importer::mjcf
