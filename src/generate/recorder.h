// Recorder: the graph of a step and the tile that it is written down in. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <set>

#include "../kernels/lay_out.h"
#include "recorded.h"
#include "sums.h"

namespace lockstep::generate {

using RecordedTile = kernels::Tile<Recorded>;

class Recorder {
 public:
  /// Lays out the tile, every number of it read from the kernel's own memory, and becomes the thread's recorder.
  Recorder(const Tables<double>& tables, RecordedTile& tile);
  ~Recorder() { recorder = nullptr; }
  Recorder(const Recorder&) = delete;

  /// Rows of the batch, of which numbers are loaded: `count` of them, `name` in C++, `array` as in Access.
  void add_rows(const double* first, int count, const std::string& name, int array);

  /// Code that works on the tile in memory: what has changed is stored before, and read again afterwards.
  void run(const std::string& code, Call call = Call::none);
  /// hold(): stores what the step came to and what it flags by, and reads again where the step ends.
  void hold_if(Id condition, Id failed);
  /// compete(): stores all that it may read - no array that is `unread` - and reads again where the step ends.
  void compete_if(Id suspect, const std::set<std::string>& unread);
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
  void know(Recorded& number, Recorded is);

  Id load(const double* p);
  void name(const void* place, Id id);

  Graph graph;
  std::vector<Place> idle;  ///< inputs that no result depends on

 private:
  /// A number of the tile.
  struct Slot {
    Id* now;             ///< the node that stands there
    Id stored;           ///< the node that the kernel's own memory holds
    Place place;
    std::string name;
    kernels::Lasts lasts;
    bool mask;
  };
  struct Rows {
    const double* first;
    int count;
    std::string name;
    int array;
  };

  static bool is_shared(const Slot& slot) { return slot.lasts == kernels::Lasts::step || slot.lasts == kernels::Lasts::state; }

  friend struct Take;
  void add_slot(Id* now, const Place& place, const std::string& name, kernels::Lasts lasts, bool mask = false);
  template <class Wanted>
  std::vector<Store> changed(Wanted wanted);
  void read(Slot& slot);
  Id sum(const Sum& asked, Op op, Id a, Id b, Id c);
  Addend addend(const Term& term) const;
  template <class Ends>
  void run_if(Id condition, std::vector<Store> stores, const std::string& code, Call call, Ends ends);

  std::unique_ptr<std::byte[]> block_;
  std::size_t used_ = 0;
  int arrays_ = 0;
  std::vector<Slot> slots_;
  std::vector<int> slot_at_;  ///< by place in the block, -1 for none
  std::vector<Rows> rows_;
  const std::vector<std::vector<Term>>* terms_ = nullptr;
  std::vector<Sum> sums_;
  bool learns_ = false, aside_ = false;
  int stage_ = 0;
};

}  // namespace lockstep::generate
