// What linear relations leave of the joints' freedom. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <vector>

#include "scene.h"

namespace lockstep::importer::mjcf {

/// Joints as affine functions of those that stay independent, by elimination.
class Ties {
 public:
  enum class Added { ties, redundant, contradiction };

  /// Lets form = 0 hold from now on, by tying its first joint that is still independent.
  Added add(const Form& form);
  /// The form in independent joints alone. Rounding of coefficients is gone.
  Form reduced(const Form& form) const;
  const std::map<int, Form>& tied() const { return tied_; }

 private:
  std::map<int, Form> tied_;           // by joint
  std::map<int, std::set<int>> with_;  // by joint: tied ones whose forms have it, or have had it
  std::set<int> changed_;              // tied ones that the last addition changed
};

}  // namespace lockstep::importer::mjcf
