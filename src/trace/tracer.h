// Tracer: the graph of a step, and the tile that the kernels run on. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "kernels/tile/lay_out.h"
#include "reassociate.h"
#include "traced.h"

namespace lockstep::trace {

using TracedTile = kernels::Tile<Traced>;

class Tracer {
 public:
  /// Lays out the tile and becomes the thread's tracer. Each number of the tile is an input: its place in the kernel's
  /// own tile. Only a `routine` (kernels/tile/routines.h) finds there what stages leave outside arrays.
  Tracer(const Tables<double>& tables, TracedTile& tile, bool routine = false);
  ~Tracer() { tracer = nullptr; }
  Tracer(const Tracer&) = delete;

  /// Declares rows of the batch: `count` of them, with `name` in C++ and `array` as in Access.
  void add_rows(const double* first, int count, const std::string& name, int array);

  /// Records code that works on the tile in memory. Changed numbers are stored before it and read again after it.
  void run(const std::string& code, Call call = Call::none);
  /// Records hold() under a condition. The new state and the masks are stored, and the state is read again.
  void hold_if(Id condition, Id failed, bool turns, bool audits);
  /// Records solve_bounds() under a condition. Everything is stored except for `unread` arrays, and the new state is
  /// read again.
  void solve_bounds_if(Id candidate, const std::set<const void*>& unread);
  /// Records step_again() under a condition. The tile in memory has the state at the start of the step, and the new
  /// state is read again.
  void step_again_if(Id candidate);
  /// Records halve_again() under a condition.
  void halves_if(Id coarse, int depth);
  /// Records the end of a routine: what it has changed goes to memory.
  void end_routine();
  /// Records audit() under a condition.
  void audit_if(Id fast);
  /// Writes the changed numbers of the state to the tile's memory: for called stages, and for the next step.
  void keep_state();

  /// Begins the first tracing, which decides how sums are added up: sums are recorded, and calls are left out.
  void learn() { sums_.clear(), learns_ = true; }
  bool learns() const { return learns_; }
  void leave_out() { ++stage_; }
  /// Begins a further tracing: sums are recorded, and added up from these terms.
  void add_up(const std::vector<std::vector<Term>>& terms) { sums_.clear(), terms_ = &terms; }
  /// Runs `look` without recording its sums: they are not reassociated.
  template <class Look>
  void aside(Look look) {
    const bool before = std::exchange(aside_, true);
    look();
    aside_ = before;
  }
  /// Records `body` as a scope: it runs if a lane of the mask is true, or, with `unless`, if none is. Numbers of the
  /// tile that it changes have their values of before where it does not run.
  void when(Id mask, bool unless, const std::function<void()>& body);
  /// Records `body` as a scope that runs while a lane of the mask is true, at most so often.
  void repeat_while(Id& mask, int most, const std::function<void()>& body);
  /// Runs `body` as a subroutine: it is traced once, and reads and changes numbers of the tile. The key tells which it
  /// is.
  void subroutine(const std::pair<const void*, std::string>& key, const std::function<void()>& body);
  /// The graph of the whole step.
  Graph take_graph();
  Id sum(Op op, Id a, Id b);
  /// A multiply-add. It is a sum if one factor is 1 or -1.
  Id product_and(Op op, Id a, Id b, Id c);
  const std::vector<Sum>& sums() const { return sums_; }

  /// The number in the tile's memory is known to be `is`, so it need not be stored.
  void know(Traced& number, Traced is);

  Id load(const double* p);
  void name(const void* place, Id id);

  Graph graph;
  std::vector<Place> unused_inputs;  ///< inputs that no result depends on
  bool scopes = false;               ///< stages that decide by values are traced where they can be

 private:
  /// A number of the tile.
  struct TileNumber {
    Id* now;    ///< its node
    Id stored;  ///< the node whose value the kernel's own tile has in memory
    Place place;
    std::string name;
    kernels::Lifetime lasts;
    const void* array;  ///< the array that it is in; null for a mask of the tile itself
    bool mask;
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

  struct Subroutine {
    int number = -1;                         ///< in graphs_
    std::vector<std::size_t> read, changed;  ///< numbers of the tile
  };
  Subroutine trace_subroutine(const std::function<void()>& body);

  friend struct Take;
  void add_number(Id* now, const Place& place, const std::string& name, kernels::Lifetime lasts, const void* array,
                  bool mask);
  template <class Wanted>
  std::vector<Write> changed(Wanted wanted);
  void read(TileNumber& number);
  Place place_of_candidates() const;
  std::vector<Id> numbers_now() const;
  std::vector<std::size_t> changed_since(const std::vector<Id>& before) const;
  Id sum(const Sum& traced, Op op, Id a, Id b, Id c);
  Addend addend(const Term& term) const;
  void run_if(Id condition, std::vector<Write> stores, const std::string& code, Call call,
              const std::set<const void*>& ends);

  const TracedTile& tile_;
  std::vector<std::byte> block_;
  std::size_t used_ = 0;
  int arrays_ = 0;
  std::vector<TileNumber> numbers_;
  std::vector<std::shared_ptr<Graph>> graphs_;  ///< of subroutines
  std::map<std::pair<const void*, std::string>, Subroutine> subroutines_;
  std::vector<int> number_at_;  ///< by place in the block: index in numbers_, -1 if none
  std::vector<Rows> rows_;
  const std::vector<std::vector<Term>>* terms_ = nullptr;
  std::vector<Sum> sums_;
  bool learns_ = false, aside_ = false;
  int stage_ = 0;
};

}  // namespace lockstep::trace
