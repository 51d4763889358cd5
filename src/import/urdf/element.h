// One element of a URDF file. Its attributes are read strictly. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tinyxml2.h>

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "import/attributes.h"
#include "import/report.h"
#include "import/text.h"

namespace lockstep::importer::urdf {

/// What all elements of one file share.
struct File {
  std::string name;  ///< in errors
  Report report;
};

/// Remembers which attributes and children were read, so that tally_rest() can report all others. Every failure is an
/// ImportError that names the file, the line and the element.
class Element {
 public:
  /// `title` names it in errors: "joint 'elbow'", "origin of joint 'elbow'".
  Element(const tinyxml2::XMLElement& xml, File& file, std::string title)
      : xml_(&xml), file_(&file), title_(std::move(title)) {}

  const std::string& title() const { return title_; }
  Report& report() const { return file_->report; }
  void rename(std::string title) { title_ = std::move(title); }

  // --- attributes: those without a fallback are required ----------------------------------------
  bool has(const char* attribute) const { return xml_->Attribute(attribute) != nullptr; }
  bool has_blank(const char* attribute) const { return has(attribute) && trimmed(xml_->Attribute(attribute)).empty(); }
  std::string name(const char* attribute);
  double number(const char* attribute);
  double number(const char* attribute, double fallback);
  Eigen::Vector3d triple(const char* attribute);
  Eigen::Vector3d triple(const char* attribute, const Eigen::Vector3d& fallback);
  /// Not strict: empty if it is there but is no finite number.
  std::optional<double> number_if_any(const char* attribute, double fallback);

  // --- children ---------------------------------------------------------------------------------
  std::optional<Element> child(const char* name);      ///< the first; others are a warning
  std::optional<Element> one_child(const char* name);  ///< at most one
  Element only_child(const char* name);                ///< exactly one
  /// All children of that name, in order. Their titles are their tags.
  template <class Use>
  void each_child(const char* name, Use use);
  std::string text() const;  ///< between its tags, without blanks around it; empty if there is none

  /// Reports every attribute, child and text that was not read. `owner` ends each line ("... of fixed joints").
  /// Call it last. Throws if xacro is left in the file, and where the name of what was not read speaks of a mimic.
  void tally_rest(const std::string& owner = "");
  /// Throws if a child is left of xacro.
  void refuse_xacro() const;
  /// Throws if there is an attribute, child or text that was not read. `remedy` says what the element may hold.
  void refuse_rest(const std::string& remedy) const;

  std::string line() const;  ///< "file:line"
  /// "file:line: title". fail() throws an error there.
  std::string place() const;
  [[noreturn]] void fail(const std::string& rule, const std::string& remedy) const;
  /// Keeps the error for Report::stop_if_refused() instead of throwing it.
  void refuse_later(const std::string& rule, const std::string& remedy) const;

 private:
  Fail failing() const {
    return [this](const std::string& rule, const std::string& remedy) { fail(rule, remedy); };
  }
  std::string_view required(const char* attribute);
  void numbers(const char* attribute, std::string_view text, double* values, int count) const;
  void tally_attribute(std::string_view name, const std::string& owner);
  void tally_child(std::string_view tag, const std::string& owner);
  void refuse_mimic(std::string_view name, const std::string& owner) const;

  const tinyxml2::XMLElement* xml_;
  File* file_;
  std::string title_;
  std::vector<std::string_view> asked_attributes_, asked_children_;  // string literals
};

template <class Use>
void Element::each_child(const char* name, Use use) {
  asked_children_.push_back(name);
  for (auto* xml = xml_->FirstChildElement(name); xml; xml = xml->NextSiblingElement(name))
    use(Element(*xml, *file_, std::string("<") + name + ">"));
}

}  // namespace lockstep::importer::urdf
