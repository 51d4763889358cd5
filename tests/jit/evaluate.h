// A graph node by node on wide numbers: the oracle of machine code. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstring>
#include <map>
#include <memory>
#include <stdexcept>
#include <vector>

#include "jit/frame.h"
#include "simd/sincos.h"
#include "trace/ir.h"
#include "trace/liveness.h"

namespace lockstep::jit {

/// Reads and writes the tile of a frame as machine code does. `row` gives a row of the batch.
template <class T, class Row>
class Evaluation {
 public:
  /// `handed` are numbers that subroutines read and change, by number.
  Evaluation(const trace::Graph& graph, const TilePlaces& places, const Frame& frame, Row row,
             std::map<int, T>* handed = nullptr,
             const std::vector<std::shared_ptr<trace::Graph>>* subroutines = nullptr)
      : graph_(graph),
        places_(places),
        frame_(frame),
        row_(row),
        handed_(handed ? *handed : own_handed_),
        subroutines_(subroutines ? *subroutines : graph.subroutines),
        uses_(trace::use_counts(graph)),
        value_(graph.nodes().size()) {}

  void run() {
    for (trace::Id id = 0; id < static_cast<trace::Id>(value_.size()); ++id)
      if (node(id).op == trace::Op::constant)
        value_[id] = T(static_cast<typename T::Scalar>(node(id).value));
      else if (node(id).op == trace::Op::by_precision)
        value_[id] = T::by_precision(node(id).single, node(id).value);
    run(0, static_cast<int>(graph_.items().size()));
  }

 private:
  using Mask = typename T::Mask;

  const trace::Node& node(trace::Id id) const { return graph_.nodes()[static_cast<std::size_t>(id)]; }
  T value(trace::Id id) const {
    if (node(id).op == trace::Op::variable && node(id).operand[0] >= 0) id = node(id).operand[0];
    return value_[static_cast<std::size_t>(id)];
  }
  static Mask mask(T number) { return {bits(number)}; }
  static T number(Mask mask) { return T::from_bits(mask.bits); }

  void compute(const trace::Item& item) {
    for (trace::Id id : item.nodes)
      if (uses_[static_cast<std::size_t>(id)] > 0) value_[static_cast<std::size_t>(id)] = result(id);
  }

  T result(trace::Id id) const {
    const auto of = [&](int i) { return value(node(id).operand[static_cast<std::size_t>(i)]); };
    switch (node(id).op) {
      case trace::Op::input: return read(node(id).place);
      case trace::Op::negate: return -of(0);
      case trace::Op::add: return of(0) + of(1);
      case trace::Op::subtract: return of(0) - of(1);
      case trace::Op::multiply: return of(0) * of(1);
      case trace::Op::divide: return of(0) / of(1);
      case trace::Op::fma: return fma(of(0), of(1), of(2));
      case trace::Op::fnma: return fnma(of(0), of(1), of(2));
      case trace::Op::sqrt: return sqrt(of(0));
      case trace::Op::farther: return farther(of(0), of(1));
      case trace::Op::sine:
      case trace::Op::cosine: {
        T sine, cosine;
        sincos(of(0), sine, cosine);
        return node(id).op == trace::Op::sine ? sine : cosine;
      }
      case trace::Op::none: return number(T::none());
      case trace::Op::less: return number(less(of(0), of(1)));
      case trace::Op::beyond: return number(beyond(of(0), of(1)));
      case trace::Op::either: return number(mask(of(0)) | mask(of(1)));
      case trace::Op::both: return number(mask(of(0)) & mask(of(1)));
      case trace::Op::invert: return number(~mask(of(0)));
      case trace::Op::select: return select(mask(of(0)), of(1), of(2));
      default: throw std::logic_error("an operation that the oracle does not know");
    }
  }

  void run(int first, int last) {
    for (int i = first; i < last; ++i) {
      const trace::Item& item = graph_.items()[static_cast<std::size_t>(i)];
      if (item.kind == trace::Item::straight) compute(item);
      if (item.kind == trace::Item::loop) loop(item);
      if (item.kind == trace::Item::effect) item.subroutine >= 0 ? run_subroutine(item) : effect(item);
      if (item.kind != trace::Item::begin_scope) continue;
      scope(item, i + 1);
      i = item.other_end;
    }
  }

  void scope(const trace::Item& item, int first) {
    const auto values_of = [&](const std::vector<trace::Id>& ids) {
      std::vector<T> values;
      for (trace::Id id : ids) values.push_back(value(id));
      return values;
    };
    assign(item.variable, values_of(item.start));
    if (any(mask(value(item.condition))) == item.unless) return;
    for (int turn = 0; turn < item.times; ++turn) {
      run(first, item.other_end);
      const bool ends = item.again < 0 || !any(mask(value(item.again)));
      assign(item.variable, values_of(item.next));
      if (ends) return;
    }
  }

  void loop(const trace::Item& item) {
    std::vector<T> next;
    for (trace::Id start : item.start) next.push_back(value(start));
    for (int turn = 0; turn < item.times; ++turn) {
      assign(item.variable, next);
      compute(item);
      next.clear();
      for (trace::Id id : item.next) next.push_back(value(id));
    }
    assign(item.variable, next);
  }
  void assign(const std::vector<trace::Id>& variables, const std::vector<T>& numbers) {
    for (std::size_t i = 0; i < variables.size(); ++i) value_[static_cast<std::size_t>(variables[i])] = numbers[i];
  }

  // One of whose results nothing is used does not run, although it may call stages.
  void run_subroutine(const trace::Item& item) {
    const auto is_used = [&](trace::Id id) { return uses_[static_cast<std::size_t>(id)] > 0; };
    if (std::none_of(item.variable.begin(), item.variable.end(), is_used)) return;
    for (const trace::Write& argument : item.stores) handed_[argument.place.number] = value(argument.value);
    Evaluation(*subroutines_[static_cast<std::size_t>(item.subroutine)], places_, frame_, row_, &handed_, &subroutines_)
        .run();
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      value_[static_cast<std::size_t>(item.variable[i])] = handed_[item.place[i].number];
  }

  void effect(const trace::Item& item) {
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      value_[static_cast<std::size_t>(item.variable[i])] = value(item.start[i]);
    if (item.condition >= 0 && !any(mask(value(item.condition)))) return;
    std::vector<std::pair<trace::Place, T>> writes;
    for (std::size_t i = 0; i < item.variable.size(); ++i) writes.push_back({item.place[i], value(item.start[i])});
    for (const trace::Write& store : item.stores) writes.push_back({store.place, value(store.value)});
    for (const auto& [place, number] : writes)
      if (place.array == Access::handed)
        handed_[place.number] = number;
      else
        std::memcpy(address(place), &number, sizeof(T));
    if (item.call != Call::none) places_.call(&frame_, static_cast<int>(item.call));
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      value_[static_cast<std::size_t>(item.variable[i])] = read(item.place[i]);
  }

  std::byte* address(const trace::Place& place) const {
    if (place.array == Access::failed) return static_cast<std::byte*>(frame_.slots);
    if (place.array == Access::own) return static_cast<std::byte*>(frame_.tile) + places_.own[place.number];
    return static_cast<std::byte*>(frame_.block) + places_.first[place.array] +
           static_cast<std::size_t>(place.number) * sizeof(T);
  }
  T read(const trace::Place& place) const {
    if (place.array >= Access::first_row) return row_(place.array, place.number);
    if (place.array == Access::handed) return handed_[place.number];
    T number;
    std::memcpy(&number, address(place), sizeof(T));
    return number;
  }

  const trace::Graph& graph_;
  const TilePlaces& places_;
  const Frame& frame_;
  Row row_;
  std::map<int, T> own_handed_;
  std::map<int, T>& handed_;
  const std::vector<std::shared_ptr<trace::Graph>>& subroutines_;
  std::vector<int> uses_;
  std::vector<T> value_;  // by node
};

}  // namespace lockstep::jit
