// Gauss's elimination, in the order of the file. SPDX-License-Identifier: Apache-2.0
#include "ties.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lockstep::importer::mjcf {
namespace {

constexpr double rounding = 1e-12;  // of the largest coefficient

}  // namespace

Form Ties::reduced(const Form& form) const {
  Form result;
  result.constant = form.constant;
  double largest = 0.0;
  for (const auto& [joint, coefficient] : form.terms) {
    largest = std::max(largest, std::abs(coefficient));
    const auto found = tied_.find(joint);
    if (found == tied_.end()) {
      result.add(joint, coefficient);
      continue;
    }
    for (const auto& [independent, factor] : found->second.terms) result.add(independent, coefficient * factor);
    result.constant += coefficient * found->second.constant;
  }
  std::erase_if(result.terms, [&](const auto& term) { return std::abs(term.second) <= rounding * largest; });
  return result;
}

Ties::Added Ties::add(const Form& form) {
  const Form left = reduced(form);
  if (left.terms.empty()) return std::abs(left.constant) < 1e-9 ? Added::redundant : Added::contradiction;
  // The first joint of the form, if it is still independent.
  auto pivot = std::find_if(left.terms.begin(), left.terms.end(),
                            [&](const auto& term) { return term.first == form.terms.front().first; });
  if (pivot == left.terms.end()) pivot = left.terms.begin();
  const int joint = pivot->first;
  Form solved;
  solved.constant = -left.constant / pivot->second;
  for (const auto& term : left.terms)
    if (term.first != joint) solved.add(term.first, -term.second / pivot->second);
  tied_[joint] = solved;
  // Forms with the joint are reduced, and those of the last time once more: their rounding is known then.
  std::set<int> again = std::exchange(changed_, with_[joint]);
  again.insert(changed_.begin(), changed_.end());
  again.insert(joint);
  for (const int other : again) {
    Form& own = tied_.at(other);
    own = reduced(own);
    for (const auto& term : own.terms) with_[term.first].insert(other);
  }
  return Added::ties;
}

}  // namespace lockstep::importer::mjcf
