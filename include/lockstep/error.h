// What is thrown, and when. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "lockstep/enums.h"
#include "lockstep/export.h"

namespace lockstep {

/// A code, what it stands for, and what to do in general; the remedy of an error says it of its case. Codes stay what
/// they are from version to version; words of messages may change.
struct ErrorCode {
  const char* code;
  const char* meaning;
  const char* remedy;
};

/// All codes of errors and faults: docs/errors.md is written from this.
LOCKSTEP_API std::span<const ErrorCode> error_codes() noexcept;

/// "fault.not_finite" ...; "" for Fault::none and what is no enumerator. The string lives forever.
LOCKSTEP_API const char* code_of(Fault fault) noexcept;

/// Why something is refused.
struct Reason {
  std::string element;  ///< what is named
  std::string rule;     ///< that it breaks
  std::string remedy;
};

/// Every error names the element, the rule that it breaks and the remedy; what() is "element: rule; remedy". Its code()
/// says which class of error it is and what kind of element is named: "model.joint", "settings.dt", "usage.save", or
/// the class alone, "import". A file may be refused for several reasons: what() has a line for each.
/// Thrown by importing, compiling and using a Batch, never by Batch::step.
class LOCKSTEP_API Error : public std::runtime_error {
 public:
  /// A bug of the library: its code is "internal".
  Error(const std::string& element, const std::string& rule, const std::string& remedy)
      : Error("internal", std::vector{Reason{element, rule, remedy}}) {}

  /// One of error_codes().
  const char* code() const noexcept { return code_; }
  // Those of the first reason.
  const std::string& element() const noexcept { return reasons_.front().element; }
  const std::string& rule() const noexcept { return reasons_.front().rule; }
  const std::string& remedy() const noexcept { return reasons_.front().remedy; }
  /// At least one.
  const std::vector<Reason>& reasons() const noexcept { return reasons_; }

 protected:
  Error(const char* group, std::vector<Reason> reasons);

 private:
  std::vector<Reason> reasons_;
  const char* code_;
};

/// The mechanism is impossible or incomplete (a link, joint, coupling or site is named; behind file and line if it
/// comes from a file).
class LOCKSTEP_API ModelError : public Error {
 public:
  ModelError(const std::string& element, const std::string& rule, const std::string& remedy)
      : ModelError(std::vector{Reason{element, rule, remedy}}) {}
  explicit ModelError(std::vector<Reason> reasons) : Error("model", std::move(reasons)) {}
};

/// A file cannot be read as a mechanism (the file and, where known, the line is named).
class LOCKSTEP_API ImportError : public Error {
 public:
  ImportError(const std::string& element, const std::string& rule, const std::string& remedy)
      : ImportError(std::vector{Reason{element, rule, remedy}}) {}
  explicit ImportError(std::vector<Reason> reasons) : Error("import", std::move(reasons)) {}
};

/// A setting is out of its range, or does not apply to this model (the setting is named).
class LOCKSTEP_API SettingsError : public Error {
 public:
  SettingsError(const std::string& element, const std::string& rule, const std::string& remedy)
      : Error("settings", std::vector{Reason{element, rule, remedy}}) {}
};

/// A Plan or Batch was asked for something that it does not hold (an index, a name, an undeclared field).
class LOCKSTEP_API UsageError : public Error {
 public:
  UsageError(const std::string& element, const std::string& rule, const std::string& remedy)
      : Error("usage", std::vector{Reason{element, rule, remedy}}) {}
};

}  // namespace lockstep
