#include <algorithm>
#include <stdexcept>

#include "../kernels/listed.h"
#include "made.h"

namespace lockstep::generate {
namespace {

class Slots {
 public:
  explicit Slots(const MadeList& made)
      : made_(made), slot_(static_cast<std::size_t>(made.values), none), last_use_(slot_.size(), -1),
        passed_on_(slot_.size(), false) {
    for (const Made& constant : made.constants_first) slot_[constant.to] = count_++;
    for (const Touch& read : made.before) slot_[read.value] = count_++;
    lasting_ = count_;
    for (int i = 0; i < static_cast<int>(made.operations.size()); ++i) {
      const Made& operation = made.operations[i];
      used_by(operation, [&](Value v) { last_use_[v] = i; });
      if (operation.last != Last::none) passed_on_[operation.from[static_cast<int>(operation.last) - 1]] = true;
    }
  }

  int count() const { return count_; }
  bool has(Value v) const { return v >= 0 && !passed_on_[v]; }
  int of(Value v) const { return slot_[v]; }

  // What operation i is the last to want leaves its slot to what it makes.
  void go_on_to(int i) {
    const Made& operation = made_.operations[i];
    used_by(operation, [&](Value v) {
      if (last_use_[v] == i) leave(v);
    });
    const Value results[] = {operation.to, operation.also_to};
    for (Value v : results) take(v);
    for (Value v : results)
      if (has(v) && last_use_[v] < 0) leave(v);
  }

 private:
  static constexpr int none = -1;

  void leave(Value v) {
    if (!has(v) || slot_[v] < lasting_) return;
    if (std::find(free_.begin(), free_.end(), slot_[v]) == free_.end()) free_.push_back(slot_[v]);
  }
  void take(Value v) {
    if (!has(v) || slot_[v] != none) return;
    if (free_.empty()) free_.push_back(count_++);
    slot_[v] = free_.back();
    free_.pop_back();
  }

  const MadeList& made_;
  std::vector<int> slot_, last_use_, free_;  // by value, by value; the one left last is in the cache
  std::vector<char> passed_on_;              // in registers
  int count_ = 0, lasting_;                  // below lasting_ slots are nobody else's
};

std::uint16_t short_of(std::size_t number) {
  if (number > 0xffff) throw std::length_error("a list is longer than its numbers allow");
  return static_cast<std::uint16_t>(number);
}

class Writer {
 public:
  explicit Writer(const MadeList& made) : slots_(made) {
    for (const Made& constant : made.constants_first) constants_first_.push_back(operation(constant));
    for (std::size_t i = 0; i < made.operations.size(); ++i) {
      slots_.go_on_to(static_cast<int>(i));
      step_.push_back(operation(made.operations[i]));
    }
    for (std::vector<Operation>* list : {&constants_first_, &step_}) list->push_back(operation({.does = Does::end}));
    find_pairs();
  }

  OperationList keep(const MadeList& made, lockstep::Store& store) {
    const auto accesses_of = [&](const std::vector<Touch>& touches) {
      std::vector<Access> all;
      for (const Touch& touch : touches) all.push_back(access(touch));
      return store.keep(std::move(all));
    };
    return {.constants_first = store.keep(std::move(constants_first_)), .before = accesses_of(made.before),
            .step = store.keep(std::move(step_)), .after = accesses_of(made.after), .apart = made.apart,
            .constants = store.keep(std::vector(made.constants)), .accesses = store.keep(std::move(accesses_)),
            .slots = slots_.count()};
  }

 private:
  Operation operation(const Made& made) {
    const auto slot = [&](Value v) {
      return slots_.has(v) ? short_of(static_cast<std::size_t>(slots_.of(v))) : std::uint16_t{0};
    };
    const Form form{made.does, made.last, is_arithmetic(made.does) && slots_.has(made.to)};
    Operation o{.form = short_of(static_cast<std::size_t>(form.number())), .to = slot(made.to),
                .a = slot(made.from[0]), .b = slot(made.from[1]), .c = slot(made.from[2]), .d = 0};
    if (made.constant >= 0) o.a = short_of(static_cast<std::size_t>(made.constant));
    switch (made.does) {
      case Does::sincos: o.c = slot(made.also_to); break;
      case Does::read:
      case Does::write:
        o.a = accesses_so_far();
        add(made.reads), add(made.writes);
        break;
      case Does::call: o.a = static_cast<std::uint16_t>(made.call); break;
      case Does::call_if:
        o.to = slot(made.from[0]), o.d = static_cast<std::uint16_t>(made.call);
        o.a = accesses_so_far(), add(made.writes);
        o.b = accesses_so_far(), add(made.reads);
        o.c = accesses_so_far();
        break;
      default: break;
    }
    return o;
  }

  std::uint16_t accesses_so_far() const { return short_of(accesses_.size()); }
  void add(const std::vector<Touch>& touches) {
    for (const Touch& touch : touches) accesses_.push_back(access(touch));
  }
  Access access(const Touch& touch) const {
    const bool fits = touch.place.array < kernels::Places::most || touch.place.array >= Access::first_row;
    if (!fits) throw std::logic_error("a tile has more arrays than lists can name: see kernels::Places");
    return {slots_.of(touch.value), touch.place.array, touch.place.number};
  }

  void find_pairs() {
    const auto is = [](const Operation& o, Form form) { return o.form == form.number(); };
    for (std::size_t i = 0; i + 1 < step_.size(); ++i)
      for (int index = 0; index < Superoperator::count; ++index) {
        const auto pair = Superoperator::of(index);
        if (!is(step_[i], pair.first) || !is(step_[i + 1], pair.second)) continue;
        step_[i++].form = static_cast<std::uint16_t>(single_forms + index);
        break;
      }
  }

  Slots slots_;
  std::vector<Operation> constants_first_, step_;
  std::vector<Access> accesses_;
};

}  // namespace

OperationList in_slots(const MadeList& made, lockstep::Store& store) { return Writer(made).keep(made, store); }

}  // namespace lockstep::generate
