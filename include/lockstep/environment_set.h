// EnvironmentSet: which environments a function of a Batch is about. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <ranges>
#include <type_traits>
#include <vector>

#include "lockstep/error.h"

namespace lockstep {

/// Environments of a batch: all of them, those whose places are listed, or those with a true in a mask that has one
/// entry for each. What converts to one:
///
///     batch.reset();                                        // all
///     batch.reset({3, 17});                                 // places; {} is nobody
///     batch.reset(ids);                                     // contiguous ints: std::vector, std::span, arrays
///     batch.reset(ended);                                   // contiguous bools or bytes of 0 and 1, std::vector<bool>
///     batch.reset(batch.positions().row(0) > 0.5f);         // an Eigen expression of bools
///
/// It refers to the numbers that it is made of, so these must live as long; braces, std::vector<bool> and Eigen
/// expressions are copied. Spans allocate nothing. Places come in the order of the list, and one that is listed twice
/// is treated twice.
class EnvironmentSet {
  template <class R, class Number>
  static constexpr bool holds = std::same_as<std::remove_cv_t<std::ranges::range_value_t<R>>, Number>;

 public:
  static EnvironmentSet all() { return EnvironmentSet(Kind::all); }

  EnvironmentSet(std::initializer_list<int> places) : kind_(Kind::own), own_(places) {}
  /// A mask in braces: `{true, false}`.
  template <std::same_as<bool> B>
  EnvironmentSet(std::initializer_list<B> mask) : EnvironmentSet(mask, mask.size()) {}

  template <std::ranges::contiguous_range R>
  requires(holds<R, int> && !std::is_base_of_v<Eigen::EigenBase<R>, R>) EnvironmentSet(const R& places)
      : kind_(Kind::places), count_(std::ranges::size(places)), places_(std::ranges::data(places)) {}
  template <std::ranges::contiguous_range R>
  requires((holds<R, bool> || holds<R, std::uint8_t>)&&!std::is_base_of_v<Eigen::EigenBase<R>, R>)
      EnvironmentSet(const R& mask)
      : kind_(Kind::mask),
        count_(std::ranges::size(mask)),
        mask_(reinterpret_cast<const unsigned char*>(std::ranges::data(mask))) {}

  EnvironmentSet(const std::vector<bool>& mask) : EnvironmentSet(mask, mask.size()) {}
  /// Throws UsageError unless it is one row or one column.
  template <class Mask>
  requires std::same_as<typename Mask::Scalar, bool> EnvironmentSet(const Eigen::DenseBase<Mask>& mask)
      : EnvironmentSet(line_of(mask).reshaped(), static_cast<std::size_t>(mask.size())) {}

  /// Calls act(place) for each, in a batch of so many environments. Throws UsageError before the first call for places
  /// outside the batch, for a mask of another length and for bytes that are not 0 or 1.
  template <class Act>
  void for_each(int environments, const Act& act) const {
    check(environments);
    if (kind_ == Kind::all)
      for (int e = 0; e < environments; ++e) act(e);
    else if (kind_ == Kind::mask)
      for (int e = 0; e < environments; ++e) mask_[e] ? act(e) : void();
    else if (kind_ == Kind::places)
      for (std::size_t i = 0; i < count_; ++i) act(places_[i]);
    else
      for (const int place : own_) act(place);
  }

  /// Throws as for_each() does.
  LOCKSTEP_API void check(int environments) const;

 private:
  enum class Kind { all, places, mask, own };
  explicit EnvironmentSet(Kind kind) : kind_(kind) {}

  // Copies a mask.
  template <class Bools>
  EnvironmentSet(const Bools& mask, std::size_t length) : kind_(Kind::own), count_(length), own_is_mask_(true) {
    int place = 0;
    for (const bool chosen : mask) {
      if (chosen) own_.push_back(place);
      ++place;
    }
  }

  template <class Mask>
  static const Mask& line_of(const Eigen::DenseBase<Mask>& mask) {
    if (mask.rows() == 1 || mask.cols() == 1) return mask.derived();
    throw UsageError("mask of environments",
                     "is " + std::to_string(mask.rows()) + " x " + std::to_string(mask.cols()) + ", so not one row",
                     "give one number per environment");
  }

  Kind kind_;
  std::size_t count_ = 0;  // length of the list or mask
  const int* places_ = nullptr;
  const unsigned char* mask_ = nullptr;
  std::vector<int> own_;  // places
  bool own_is_mask_ = false;
};

}  // namespace lockstep
