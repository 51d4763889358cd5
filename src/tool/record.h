// Records the trajectory of one environment as CSV. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "csv.h"
#include "lockstep/batch.h"

namespace lockstep::tool {

/// Columns: time; NAME, NAME.v by joint; C.NAME by coupling; the root's pose and velocity if it floats; site.NAME.x,
/// .y, .z; fault: the number of Fault, 0 while the environment steps, else the row is that of a frozen environment.
/// Numbers have enough digits to read back to the same bits.
class Recorder {
 public:
  Recorder() = default;  ///< records nothing
  /// Throws InputError where the file cannot be written.
  Recorder(const std::string& path, int environment, const Plan& plan);

  bool active() const { return file_.has_value(); }
  /// Adds the environment's present state. `coupling_errors` are those of Batch::coupling_errors().
  template <class S>
  void add(double time, Batch<S>& batch, const typename Batch<S>::Array& coupling_errors);
  void close();

 private:
  std::optional<OutputFile> file_;
  int environment_ = 0;
};

}  // namespace lockstep::tool
