// Followers that are functions of one joint: values, numbers, rules. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/model.h"
#include "simd/curves.h"

namespace lockstep {

/// (M135) to (M137) in double.
simd::Curve<double> curve_at(const Function& function, double x);

/// What Parameter::function has of it, and what its rows are called: "c0" ..., "y0" ..., "mean", "cosine", "sine".
std::vector<double> numbers_of(const Function& function);
void set_numbers(Function& function, const std::vector<double>& numbers);
std::vector<std::string> number_names(const Function& function);
/// The pieces of a table: simd::numbers_of_piece for each point.
std::vector<double> pieces_of(const CamTable& table);

/// Positions of a joint.
struct Range {
  double lower = -infinity, upper = infinity;
};
/// Whether f' keeps its sign in the range, and never falls below a ten thousandth of its largest magnitude there.
bool is_monotone(const Function& function, const Range& range);

/// Throws ModelError for the first rule that the coupling breaks. It has a function.
void proper_function(const Coupling& coupling, const std::string& element);

/// A model's curved couplings (M138): those with a function, and hard ones that follow their followers. In an order in
/// which each can place its first joint from joints that stand. Throws ModelError if they form a ring, or if two say
/// where one joint is.
std::vector<int> curved_couplings(const Model& model);

/// Puts the first joints of these couplings where the other joints have them, in `value` and, at speed `rate`, in
/// `rate`: by joint of the model.
void place_curved(const Model& model, const std::vector<int>& couplings, std::vector<double>& value,
                  std::vector<double>& rate);
/// The same for the model's start.
void place_curved(Model& model);

}  // namespace lockstep
