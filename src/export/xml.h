// XML text, element by element. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tinyxml2.h>

#include <Eigen/Geometry>
#include <initializer_list>
#include <string>
#include <vector>

namespace lockstep::exporter {

/// Numbers with a space between them, each with the fewest digits that give the same double. Zero has no sign.
std::string numbers(const std::vector<double>& values);
inline std::string numbers(std::initializer_list<double> values) { return numbers(std::vector<double>(values)); }
inline std::string numbers(const Eigen::Vector3d& v) { return numbers({v[0], v[1], v[2]}); }
inline std::string numbers(double value) { return numbers({value}); }

class Xml {
 public:
  Xml& open(const char* tag) { return printer_.OpenElement(tag), *this; }
  /// Of the element that was opened last, before it has children.
  Xml& set(const char* name, const std::string& value) { return printer_.PushAttribute(name, value.c_str()), *this; }
  Xml& set_unless(double usual, const char* name, double value) {
    return value == usual ? *this : set(name, numbers(value));
  }
  Xml& close() { return printer_.CloseElement(), *this; }
  std::string text() const { return printer_.CStr(); }

 private:
  tinyxml2::XMLPrinter printer_;
};

}  // namespace lockstep::exporter
