// Tracer: the graph of a step and the tile that it is written down in. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <set>

#include "kernels/tile/lay_out.h"
#include "reassociate.h"
#include "traced.h"

namespace lockstep::trace {

using TracedTile = kernels::Tile<Traced>;

class Tracer {
 public:
  /// Lays out the tile, every number of it read from the kernel's own memory, and becomes the thread's tracer.
  Tracer(const Tables<double>& tables, TracedTile& tile);
  ~Tracer() { tracer = nullptr; }
  Tracer(const Tracer&) = delete;

  /// Rows of the batch, of which numbers are loaded: `count` of them, `name` in C++, `array` as in Access.
  void add_rows(const double* first, int count, const std::string& name, int array);

  /// Code that works on the tile in memory: what has changed is stored before, and read again afterwards.
  void run(const std::string& code, Call call = Call::none);
  /// hold(): stores what the step came to and what it flags by, and reads again where the step ends.
  void hold_if(Id condition, Id failed);
  /// solve_bounds(): stores all that it may read - no array that is `unread` - and reads again where the step ends.
  void solve_bounds_if(Id candidate, const std::set<const void*>& unread);
  /// What the next step starts from goes to memory.
  void finish();

  /// From here on sums are counted, and calls are left out, so that what they read does not count.
  void learn() { sums_.clear(), learns_ = true; }
  bool learns() const { return learns_; }
  void leave_out() { ++stage_; }
  /// From here on sums are counted, and added up of these terms.
  void add_up(const std::vector<std::vector<Term>>& terms) { sums_.clear(), terms_ = &terms; }
  /// What `look` records is beside the step: its sums do not count, and nothing becomes part of them.
  template <class Look>
  void aside(Look look) {
    aside_ = true;
    look();
    aside_ = false;
  }
  Id sum(Op op, Id a, Id b);
  /// Where a factor is 1 this is a sum as well.
  Id product_and(Op op, Id a, Id b, Id c);
  const std::vector<Sum>& sums() const { return sums_; }

  /// The tile's number is known to be `id`, and stays in memory as it is.
  void know(Traced& number, Traced is);

  Id load(const double* p);
  void name(const void* place, Id id);

  Graph graph;
  std::vector<Place> unused_inputs;  ///< inputs that no result depends on

 private:
  /// A number of the tile.
  struct TileNumber {
    Id* now;    ///< the node that stands there
    Id stored;  ///< the node that the kernel's own memory holds
    Place place;
    std::string name;
    kernels::Lifetime lasts;
    const void* array;  ///< that it is in; null for a mask
  };
  struct Rows {
    const double* first;
    int count;
    std::string name;
    int array;
  };

  static bool is_shared(const TileNumber& number) {
    return number.lasts == kernels::Lifetime::step || number.lasts == kernels::Lifetime::state;
  }

  friend struct Take;
  void add_number(Id* now, const Place& place, const std::string& name, kernels::Lifetime lasts, const void* array);
  template <class Wanted>
  std::vector<Write> changed(Wanted wanted);
  void read(TileNumber& number);
  Id sum(const Sum& asked, Op op, Id a, Id b, Id c);
  Addend addend(const Term& term) const;
  void run_if(Id condition, std::vector<Write> stores, const std::string& code, Call call,
              const std::set<const void*>& ends);

  const TracedTile& tile_;
  std::unique_ptr<std::byte[]> block_;
  std::size_t used_ = 0;
  int arrays_ = 0;
  std::vector<TileNumber> numbers_;
  std::vector<int> number_at_;  ///< by place in the block, -1 for none
  std::vector<Rows> rows_;
  const std::vector<std::vector<Term>>* terms_ = nullptr;
  std::vector<Sum> sums_;
  bool learns_ = false, aside_ = false;
  int stage_ = 0;
};

}  // namespace lockstep::trace
