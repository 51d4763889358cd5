// What is thrown, and when. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

#include "lockstep/export.h"

namespace lockstep {

/// Every error names the element, the rule that it breaks and the remedy; what() is "element: rule; remedy".
/// Thrown by importing, compiling and using a Batch, never by Batch::step.
class LOCKSTEP_API Error : public std::runtime_error {
 public:
  Error(const std::string& element, const std::string& rule, const std::string& remedy)
      : std::runtime_error(element + ": " + rule + "; " + remedy), element_(element), rule_(rule), remedy_(remedy) {}

  const std::string& element() const noexcept { return element_; }
  const std::string& rule() const noexcept { return rule_; }
  const std::string& remedy() const noexcept { return remedy_; }

 private:
  std::string element_, rule_, remedy_;
};

/// The mechanism is impossible or incomplete (a link, joint, coupling or site is named; behind file and line if it
/// comes from a file).
class LOCKSTEP_API ModelError : public Error {
  using Error::Error;
};

/// A file cannot be read as a mechanism (the file and, where known, the line is named).
class LOCKSTEP_API ImportError : public Error {
  using Error::Error;
};

/// A setting is out of its range, or does not apply to this model (the setting is named).
class LOCKSTEP_API SettingsError : public Error {
  using Error::Error;
};

/// A Plan or Batch was asked for something that it does not hold (an index, a name, an undeclared field).
class LOCKSTEP_API UsageError : public Error {
  using Error::Error;
};

}  // namespace lockstep
