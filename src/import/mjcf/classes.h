// Classes of defaults. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "element.h"

namespace lockstep::importer::mjcf {

/// All <default> sections. Each part of a document has classes of its own. A class takes its parent's attributes
/// wherever the parent states them in the section around the class or before it. Later sections do not reach it.
class Classes {
 public:
  /// Throws ImportError for a nested class without a name, and for a name that appears twice.
  explicit Classes(Document& document);

  /// The element over the defaults of its class: its own, or else `childclass`, or else the outermost one. Throws
  /// ImportError for an unknown class. `tag` is that of the defaults, if it is not the element's.
  Element element(const Element::Xml& xml, const std::string& childclass, const char* tag = nullptr) const;
  /// The defaults in that order.
  std::vector<const Element::Xml*> defaults(const Element::Xml& xml, const std::string& childclass,
                                            const std::vector<std::string_view>& tags) const;
  /// The childclass of an element, or else the one around it. Throws ImportError for an unknown class.
  std::string childclass(const Element& element, const std::string& around) const;

 private:
  struct Class {
    const Class* parent = nullptr;
    std::size_t taken = 0;  // the first elements of the parent
    std::vector<const Element::Xml*> elements;
  };
  using Named = std::unordered_map<std::string, Class>;  // which keeps them in their places

  void read(const Element& section, Class& own, Named& classes);
  const Class& find(const Element& element, const char* attribute, const std::string& name) const;

  Document& document_;
  std::vector<Named> classes_;  // by part
};

}  // namespace lockstep::importer::mjcf
