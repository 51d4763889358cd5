// One element of an MJCF file, over the defaults of its class. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "document.h"
#include "import/text.h"

namespace lockstep::importer::mjcf {

/// Attributes are looked up in layers: the defaults of the outermost class first, the element's own last. Of an
/// attribute with several numbers a later layer may replace only the first few, as in MuJoCo. Every failure is an
/// ImportError that names file, line and element.
class Element {
 public:
  using Xml = Document::Xml;

  Element(Document& document, const Xml& xml, std::vector<const Xml*> defaults = {});

  const Xml& xml() const { return *layers_.back(); }
  std::string tag() const { return xml().Name(); }
  Document& document() const { return *document_; }
  Report& report() const { return document_->report(); }
  const std::string& title() const { return title_; }
  void rename(std::string title) { title_ = std::move(title); }
  std::string place() const { return document_->line(xml()) + ": " + title_; }
  [[noreturn]] void fail(const std::string& rule, const std::string& remedy) const;

  bool has(const char* attribute) const;      ///< in any layer
  bool has_own(const char* attribute) const;  ///< in the element itself
  /// That of the attributes which the innermost layer with any of them has; null if none has one.
  const char* innermost(std::initializer_list<const char*> attributes) const;
  std::string name(const char* attribute) const;
  std::string name(const char* attribute, const std::string& fallback) const;
  double number(const char* attribute, double fallback) const;
  double number(const char* attribute) const;  ///< required
  int whole(const char* attribute, int fallback) const;
  Eigen::Vector3d triple(const char* attribute, const Eigen::Vector3d& fallback) const;
  /// Replaces the first numbers, and returns how many the last layer that has the attribute gives; 0 without one.
  int numbers(const char* attribute, double* values, int least, int most) const;
  std::vector<double> all_numbers(const char* attribute, std::size_t most) const;
  /// The index among the words. Fails for another word.
  int word(const char* attribute, std::initializer_list<const char*> words, int fallback) const;
  bool truth(const char* attribute, bool fallback) const;

  /// Child elements in order; they count as visited once an Element is made of them.
  std::vector<const Xml*> children() const { return document_->children(xml()); }

 private:
  /// The attribute in one layer, which counts as read; null if it is not there.
  const char* in(const Xml& layer, const char* attribute) const;
  const char* last(const char* attribute, const Xml*& layer) const;
  [[noreturn]] void fail_in(const Xml& layer, const std::string& rule, const std::string& remedy) const;

  Document* document_;
  std::vector<const Xml*> layers_;
  std::string title_;
};

}  // namespace lockstep::importer::mjcf
