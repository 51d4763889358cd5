#include "recorder.h"

#include <fmt/format.h>

#include <stdexcept>

#include "../kernels/projection.h"

namespace lockstep::generate {

using kernels::Lasts;

Id record_constant(double value) { return recorder->graph.constant(value); }
Id record(Op op, Id a, Id b, Id c) {
  switch (op) {
    case Op::add:
    case Op::subtract: return recorder->sum(op, a, b);
    case Op::fma:
    case Op::fnma: return recorder->product_and(op, a, b, c);
    default: return recorder->graph.operation(op, a, b, c);
  }
}
Id record_as_it_stands(Op op, Id a, Id b, Id c) { return recorder->graph.operation(op, a, b, c); }
Id record_load(const double* p) { return recorder->load(p); }
void record_name(const void* place, Id id) { recorder->name(place, id); }

namespace {

using Part = std::pair<std::string, std::string>;  // of an element: in C++, in a name

std::vector<Part> parts(const Recorded*) { return {{"", ""}}; }
std::vector<Part> parts(const simd::Vec3<Recorded>*) { return {{".x", "_x"}, {".y", "_y"}, {".z", "_z"}}; }
std::vector<Part> parts(const simd::Mat3<Recorded>*) {
  std::vector<Part> all;
  for (int k = 0; k < 9; ++k) {
    const char row = "xyz"[k / 3], column = "xyz"[k % 3];
    all.push_back({fmt::format(".{}.{}", row, column), fmt::format("_{}{}", row, column)});
  }
  return all;
}
void add_symmetric(const char* member, const char* name, std::vector<Part>& all) {
  const char* const pairs[] = {"xx", "yy", "zz", "yz", "xz", "xy"};
  for (int k = 0; k < 6; ++k) all.push_back({fmt::format(".{}[{}]", member, k), fmt::format("{}_{}", name, pairs[k])});
}
std::vector<Part> parts(const simd::PseudoInertia<Recorded>*) {
  std::vector<Part> all{{".mass", "_mass"}, {".moment.x", "_hx"}, {".moment.y", "_hy"}, {".moment.z", "_hz"}};
  add_symmetric("second", "", all);
  return all;
}
std::vector<Part> parts(const simd::ArticulatedInertia<Recorded>*) {
  std::vector<Part> all;
  add_symmetric("angular", "_angular", all);
  for (const auto& [in_code, in_name] : parts(static_cast<const simd::Mat3<Recorded>*>(nullptr)))
    all.push_back({".across" + in_code, "_across" + in_name});
  add_symmetric("linear", "_linear", all);
  return all;
}
std::vector<Part> parts(const void*) { return {}; }  // what only code that is not recorded looks at

}  // namespace

/// Takes the place of Carver. No two arrays share their room.
struct Take {
  Recorder* recorder;
  void behind(const Take&) {}  // copies share one block, and nothing shares room
  template <class E>
  void operator()(const char* name, E*& array, int count, Lasts lasts = Lasts::step) {
    const std::size_t first = recorder->used_;
    array = reinterpret_cast<E*>(recorder->block_.get() + first);
    recorder->used_ += sizeof(E) * static_cast<std::size_t>(count);
    const std::vector<Part> all = parts(array);
    Id* number = reinterpret_cast<Id*>(array);
    int in_array = 0;
    for (int i = 0; i < count; ++i)
      for (const auto& [in_code, in_name] : all)
        recorder->add_slot(number++, {fmt::format("x.{}[{}]{}", name, i, in_code), recorder->arrays_, in_array++, lasts == Lasts::call},
                           fmt::format("{}_{}{}", name, i, in_name), lasts);
    ++recorder->arrays_;
  }
};

namespace {

struct Measure {
  std::size_t* bytes;
  void behind(const Measure&) {}
  template <class E>
  void operator()(const char*, E*& array, int count, Lasts = Lasts::step) {
    array = nullptr;
    *bytes += sizeof(E) * static_cast<std::size_t>(count);
  }
};

}  // namespace

Recorder::Recorder(const Tables<double>& tables, RecordedTile& tile) {
  recorder = this;
  std::size_t bytes = 0;
  Measure measure{&bytes};
  kernels::arrays(tables, tile, measure);
  block_ = std::make_unique<std::byte[]>(bytes + 1);
  slot_at_.assign(bytes / sizeof(Id) + 1, -1);
  Take take{this};
  kernels::arrays(tables, tile, take);
  add_slot(&tile.frozen.id, {"x.frozen", Access::frozen}, "frozen", Lasts::state, true);
  add_slot(&tile.singular.id, {"x.singular", Access::singular}, "singular", Lasts::step, true);
}

void Recorder::add_slot(Id* now, const Place& place, const std::string& name, Lasts lasts, bool mask) {
  slots_.push_back({now, -1, place, name, lasts, mask});
  read(slots_.back());
  const auto offset = reinterpret_cast<std::byte*>(now) - block_.get();
  if (!mask) slot_at_[static_cast<std::size_t>(offset) / sizeof(Id)] = static_cast<int>(slots_.size()) - 1;
}

void Recorder::read(Slot& slot) {
  slot.stored = *slot.now = graph.input(slot.place, slot.mask);
  graph.name(slot.stored, slot.name);
}

void Recorder::add_rows(const double* first, int count, const std::string& name, int array) {
  rows_.push_back({first, count, name, array});
}

Id Recorder::sum(Op op, Id a, Id b) { return sum({a, b, -1, op == Op::subtract, stage_}, op, a, b, -1); }

Id Recorder::product_and(Op op, Id a, Id b, Id c) {
  if (const Id term = graph.times_one(a, b); term >= 0) return sum(op == Op::fma ? Op::add : Op::subtract, c, term);
  return sum({c, a, b, op == Op::fnma, stage_}, op, a, b, c);
}

Id Recorder::sum(const Sum& asked, Op op, Id a, Id b, Id c) {
  if (aside_) return graph.operation(op, a, b, c);
  const std::size_t number = sums_.size();
  sums_.push_back(asked);
  if (terms_ && number >= terms_->size()) throw std::logic_error("recordings of a step ask for different sums");
  if (!terms_ || (*terms_)[number].empty()) return sums_.back().result = graph.operation(op, a, b, c);
  std::vector<Addend> addends;
  for (const Term& term : (*terms_)[number]) addends.push_back(addend(term));
  return sums_.back().result = graph.added_up(addends);
}

Addend Recorder::addend(const Term& term) const {
  const Sum& sum = sums_[static_cast<std::size_t>(term.sum)];
  if (term.second && sum.factor >= 0) return {sum.second, sum.factor, term.minus};
  const Id id = term.second ? sum.second : sum.first;
  return term.apart ? graph.apart(id, term.minus) : Addend{id, -1, term.minus};
}

void Recorder::know(Recorded& number, Recorded is) {
  const auto offset = reinterpret_cast<std::byte*>(&number) - block_.get();
  Slot& slot = slots_[static_cast<std::size_t>(slot_at_[static_cast<std::size_t>(offset) / sizeof(Id)])];
  slot.stored = number.id = is.id;
}

Id Recorder::load(const double* p) {
  for (const Rows& rows : rows_)
    if (p >= rows.first && p < rows.first + rows.count) {
      const int row = static_cast<int>(p - rows.first);
      const std::string text = row == 0 ? fmt::format("T::load(lanes.{})", rows.name)
                                        : fmt::format("T::load(lanes.{} + {} * lanes.stride)", rows.name, row);
      return graph.input({text, rows.array, row, true}, false);
    }
  throw Error("a kernel", "reads a row of the batch that nobody declared", "report this as a bug");
}

void Recorder::name(const void* place, Id id) {
  const auto offset = static_cast<const std::byte*>(place) - block_.get();
  if (offset < 0 || static_cast<std::size_t>(offset) >= used_) return;
  const int slot = slot_at_[static_cast<std::size_t>(offset) / sizeof(Id)];
  if (slot >= 0) graph.name(id, slots_[slot].name);
}

template <class Wanted>
std::vector<Store> Recorder::changed(Wanted wanted) {
  std::vector<Store> stores;
  for (const Slot& slot : slots_)
    if (wanted(slot) && *slot.now != slot.stored) stores.push_back({slot.place, *slot.now});
  return stores;
}

void Recorder::run(const std::string& code, Call call) {
  if (learns_ && call != Call::none) return leave_out();
  graph.effect(changed(&Recorder::is_shared), code, call);
  graph.forget();
  for (Slot& slot : slots_)
    if (is_shared(slot)) read(slot);
}

template <class Ends>
void Recorder::run_if(Id condition, std::vector<Store> stores, const std::string& code, Call call, Ends ends) {
  std::vector<Store> before;
  std::vector<Slot*> end_slots;
  for (Slot& slot : slots_) {
    if (!ends(slot)) continue;
    before.push_back({slot.place, *slot.now});
    end_slots.push_back(&slot);
  }
  const std::vector<Id> after = graph.effect_if(condition, std::move(stores), code, call, before);
  for (std::size_t i = 0; i < after.size(); ++i) {
    *end_slots[i]->now = after[i];
    graph.name(after[i], end_slots[i]->name);
  }
}

void Recorder::hold_if(Id condition, Id failed) {
  std::vector<Store> flags;
  for (const Slot& slot : slots_)
    if (slot.name == "singular" || slot.name == "frozen") flags.push_back({slot.place, *slot.now});
  flags.push_back({{"const typename T::Mask failed", Access::failed}, failed});
  run_if(condition, std::move(flags), "hold(t, lanes, x, failed);", Call::hold,
         [](const Slot& slot) { return slot.name.starts_with("next_"); });
}

void Recorder::compete_if(Id suspect, const std::set<std::string>& unread) {
  const auto ends = [](const Slot& slot) { return slot.name.starts_with("next_") || slot.name.starts_with("half_turn_"); };
  const auto array = [](const Slot& slot) { return slot.name.substr(0, slot.name.find_first_of("0123456789") - 1); };
  std::vector<Store> stores =
      changed([&](const Slot& slot) { return is_shared(slot) && !ends(slot) && !unread.contains(array(slot)); });
  stores.push_back({{"x.suspect", Access::suspect}, suspect});
  run_if(suspect, std::move(stores), "compete(t, lanes, x);", Call::compete, ends);
}

void Recorder::finish() {
  graph.effect(changed([](const Slot& slot) { return slot.lasts == Lasts::state; }), "");
}

}  // namespace lockstep::generate
