// The importer's report. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "lockstep/error.h"
#include "lockstep/model.h"

namespace lockstep::importer {

/// Collects remarks while a file is read. Each kind of remark becomes one line.
class Report {
 public:
  /// "what (2): item, item". Lines are in the order of their first remarks.
  void remark(const std::string& what, const std::string& item) { remark(what, item, 0.0); }
  /// The largest items first.
  void remark(const std::string& what, const std::string& item, double size);
  /// The same, of what the owner of the file should look at.
  void warn(const std::string& what, const std::string& item);
  void show_all(const std::string& what) { whole_.insert(what); }  ///< this line is not shortened
  /// "what: 3 of kindA, 1 of kindB". Lines stand with the remarks.
  void tally(const std::string& what, const std::string& kind);
  void kept(const std::string& kind) { ++kept_[kind]; }  ///< of a joint: a bound that a step enforces
  void not_used(const std::string& kind, int times = 1) { not_used_[kind] += times; }  ///< part of URDF, not of a step
  void unknown(const std::string& kind) { ++unknown_[kind]; }  ///< not part of URDF: perhaps a misspelling

  /// A file that was read. Each counts once.
  void note_file(const std::string& path) {
    if (std::find(files_.begin(), files_.end(), path) == files_.end()) files_.push_back(path);
  }
  const std::vector<std::string>& files() const { return files_; }

  /// Reads or judges a part of the file. Where it is refused, the reason is kept and the result is false, so that what
  /// else is refused can be found. Throws an error with all reasons at the twentieth part.
  template <class Part>
  bool attempt(Part part);
  void refuse(const ImportError& error) { refuse(error, false); }
  bool is_full() const { return is_full_; }
  /// Throws one error with all reasons that were kept, if there are some.
  void stop_if_refused() const;

  /// The line of one kind of remark; empty if there is none.
  std::string line(const std::string& what) const;
  /// The remarks, then one line each for what was kept, not used and unknown.
  std::vector<std::string> lines() const;
  /// Those of the lines that are warnings: what warn() and unknown() were told.
  std::vector<std::string> warnings() const;

 private:
  void refuse(const Error& error, bool is_of_model);

  std::vector<std::string> order_, files_;
  std::map<std::string, std::vector<std::pair<double, std::string>>> remarks_;  // items after their sizes
  std::map<std::string, std::map<std::string, int>> tallies_;
  std::set<std::string> warned_, whole_;  // of order_
  std::map<std::string, int> kept_, not_used_, unknown_;
  std::vector<Reason> refusals_;  // each once
  int refused_ = 0;               // parts
  bool is_full_ = false;
  bool is_model_refused_ = false;  // by the first of refusals_
};

template <class Part>
bool Report::attempt(Part part) {
  try {
    part();
    return true;
  } catch (const ModelError& error) {
    if (is_full_) throw;
    refuse(error, true);
  } catch (const ImportError& error) {
    if (is_full_) throw;
    refuse(error, false);
  }
  return false;
}

/// The items with `between` them. Of a long list the middle is left out and counted.
std::string listed(const std::vector<std::string>& items, const char* between = ", ", std::size_t longest = 8);

/// "1 link", "2 links".
std::string counted(std::size_t number, const char* noun);

/// "2 links, 1 moving joint, 0 couplings". Tendons and their couplings are counted apart, where there are
/// some, and so are loops.
std::string contents_of(const Model& model);

}  // namespace lockstep::importer
