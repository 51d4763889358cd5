// Random graphs with every kind of node and effect. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "trace/ir.h"
#include "trace/liveness.h"

namespace lockstep::jit {

/// The arrays of the tile of a random graph, each of `numbers` numbers.
enum RandomArray : int { state_array, variable_array, out_array, lasting_array, random_arrays };
constexpr int random_numbers = 12, random_handed = 9;

class RandomGraph {
 public:
  RandomGraph(std::uint64_t seed, int operations) : random_(seed) {
    for (int s = below(4); s > 0; --s) add_subroutine();
    for (int i = 0; i < random_numbers; ++i) add(input(state_array, i));
    while (made_ < operations) {
      const int kind = below(40);
      if (kind == 0)
        call_if();
      else if (kind == 1)
        store();
      else if (kind == 2 && below(3) == 0)
        always_call();
      else if (kind == 3)
        below(2) ? loop() : scope(2);
      else if (kind == 4)
        run_subroutine();
      else
        operation(numbers_);
    }
    std::vector<trace::Write> kept;  // some numbers of the state change places
    for (int i = 0; i < random_numbers; ++i) kept.push_back({place(state_array, i), any_of(numbers_)});
    graph.effect(kept, "");
    trace::drop_unread_results(graph);
  }

  trace::Graph graph;

 private:
  int below(int n) { return static_cast<int>(random_() % static_cast<std::uint64_t>(n)); }
  trace::Id any_of(const std::vector<trace::Id>& ids) {
    return ids[ids.size() - 1 -
               static_cast<std::size_t>(below(static_cast<int>(std::min<std::size_t>(ids.size(), 40))))];
  }
  trace::Id any_mask() {
    if (!masks_.empty() && below(3) > 0) return any_of(masks_);
    masks_.push_back(below(4) == 0 ? graph.input({"frozen", Access::own, 0}, true)
                                   : graph.operation(trace::Op::less, any_of(numbers_), any_of(numbers_)));
    return masks_.back();
  }
  static trace::Place place(int array, int number) {
    return {"x[" + std::to_string(array) + "][" + std::to_string(number) + "]", array, number, array == lasting_array};
  }
  trace::Id input(int array, int number) { return graph.input(place(array, number), false); }
  // The number itself may be used long after its memory has changed.
  void add(trace::Id id) {
    numbers_.push_back(graph.operation(trace::Op::add, id, graph.constant(0.25)));
    numbers_.push_back(id);
  }

  void operation(std::vector<trace::Id>& numbers) {
    using trace::Op;
    ++made_;
    const trace::Id a = any_of(numbers), b = any_of(numbers), c = any_of(numbers);
    const auto put = [&](Op op, trace::Id x, trace::Id y = -1, trace::Id z = -1) {
      numbers.push_back(graph.operation(op, x, y, z));
    };
    const trace::Id two = graph.constant(2.0), half = graph.constant(0.5), near_one = graph.constant(0.95);
    switch (below(20)) {
      case 0: return put(Op::negate, a);
      case 1: return put(Op::add, a, b);
      case 2: return put(Op::subtract, a, b);
      case 3: return put(Op::multiply, graph.operation(Op::sine, a), b);
      case 4: return put(Op::divide, graph.operation(Op::cosine, a), graph.operation(Op::fma, b, b, two));
      case 5:
      case 6: return put(Op::fma, graph.operation(Op::cosine, a), b, c);
      case 7:
      case 8: return put(Op::fnma, graph.operation(Op::sine, a), b, c);
      case 9: return put(Op::fma, half, b, graph.operation(Op::negate, c));
      case 10: return put(Op::sqrt, graph.operation(Op::fma, a, a, half));
      case 11: return put(Op::farther, graph.operation(Op::multiply, a, a), b);
      case 12: return put(Op::select, any_mask(), a, b);
      case 13: masks_.push_back(graph.operation(Op::beyond, a, graph.operation(Op::multiply, b, b))); return;
      case 14: masks_.push_back(graph.operation(below(2) ? Op::either : Op::both, any_mask(), any_mask())); return;
      case 15: masks_.push_back(graph.operation(Op::invert, any_mask())); return;
      case 16: return put(Op::add, input(lasting_array, below(random_numbers)), a);
      case 17:
        return put(Op::multiply,
                   graph.input({"row" + std::to_string(made_ % 7), Access::effort, made_ % 7, true}, false), near_one);
      case 18: return put(Op::multiply, graph.by_precision(0.75, 0.875), a);
      default: return put(Op::multiply, graph.operation(Op::sine, a), graph.operation(Op::sine, b));
    }
  }

  void store() { graph.effect({{place(out_array, below(random_numbers)), any_of(numbers_)}}, ""); }

  std::vector<trace::Write> some_writes() {
    std::vector<trace::Write> writes = {{{"candidate", Access::own, 3}, any_mask()}};
    for (int i = below(4); i > 0; --i) writes.push_back({place(out_array, i), any_of(numbers_)});
    return writes;
  }

  void call_if() {
    std::vector<trace::Write> changed;
    for (int i = below(6); i >= 0; --i) changed.push_back({place(variable_array, i), any_of(numbers_)});
    // Seldom true in some lane: a mask that few pass.
    const trace::Id few = graph.operation(trace::Op::both, any_mask(), any_mask());
    std::vector<trace::Write> writes = some_writes();
    if (below(3) == 0) writes.push_back({{"failed", Access::failed}, any_mask()});
    for (trace::Id id : graph.effect_if(few, writes, "rarely", Call::hold, changed)) numbers_.push_back(id);
  }

  void always_call() {
    graph.effect(some_writes(), "always", Call::diagnose);
    graph.forget();
    for (int i = 0; i < 3; ++i) add(input(out_array, below(random_numbers)));
  }

  void loop() {
    std::vector<trace::Id> start = {any_of(numbers_), any_of(numbers_), any_of(numbers_)};
    std::vector<trace::Id> variables = graph.begin_loop(2 + below(3), start), inside = numbers_;
    const std::vector<trace::Id> outer_masks = masks_;
    inside.insert(inside.end(), variables.begin(), variables.end());
    for (int i = 6 + below(12); i > 0; --i) operation(inside);
    // Each carried number depends on a turn, and some are those of other variables.
    std::vector<trace::Id> next;
    for (trace::Id variable : variables)
      next.push_back(graph.operation(trace::Op::fnma, graph.constant(0.25), any_of(inside), variable));
    if (below(2) == 0) std::swap(next[0], next[1]);
    if (below(3) == 0) next[2] = variables[0];
    masks_ = outer_masks;
    for (trace::Id id : graph.end_loop(next)) numbers_.push_back(id);
  }

  // Some numbers change in it; some scopes are repeated, and some hold others.
  void scope(int deepest) {
    const std::vector<trace::Id> outside = numbers_, outer_masks = masks_;
    const bool repeats = below(2) == 0;
    const trace::Id some = graph.operation(trace::Op::both, any_mask(), any_mask());
    std::vector<trace::Id> start;
    if (repeats) start = {any_mask(), any_of(numbers_), any_of(numbers_)};
    const std::vector<trace::Id> variables = graph.begin_scope(some, below(3) == 0, start);
    if (repeats)
      masks_.push_back(variables[0]), numbers_.insert(numbers_.end(), variables.begin() + 1, variables.end());
    for (int i = 4 + below(20); i > 0; --i) {
      operation(numbers_);
      if (below(8) == 0 && deepest > 0) scope(deepest - 1);
      if (below(8) == 0) run_subroutine();
      if (below(12) == 0) loop();
    }
    std::vector<trace::Id> more = {outside[outside.size() - 1], outside[outside.size() - 2]}, next;
    if (repeats) next.push_back(any_mask());
    while (next.size() < start.size() + more.size())
      next.push_back(graph.operation(trace::Op::fma, graph.constant(0.5), any_of(numbers_), graph.constant(0.125)));
    trace::Id again = -1;  // a new mask, that of the next turn, or that of this turn
    if (repeats && below(2)) again = graph.operation(trace::Op::both, any_mask(), any_mask());
    if (repeats && again < 0) again = below(2) ? next[0] : variables[0];
    numbers_ = outside, masks_ = outer_masks;
    const std::vector<trace::Id> after = graph.end_scope(more, next, again, repeats ? 2 + below(4) : 1);
    if (repeats) masks_.push_back(after[0]);
    numbers_.insert(numbers_.end(), after.begin() + (repeats ? 1 : 0), after.end());
  }

  static trace::Place handed(int number) { return {"handed" + std::to_string(number), Access::handed, number}; }

  // It changes some of the numbers that are handed to it, the first of which is a mask. Others go through it.
  void add_subroutine() {
    trace::Graph around = std::exchange(graph, {});
    graph.subroutines = around.subroutines;  // it may run those before it
    masks_ = {graph.input(handed(0), true)};
    for (int i = 1; i < random_handed; ++i) numbers_.push_back(graph.input(handed(i), false));
    for (int i = 10 + below(30); i > 0; --i) {
      operation(numbers_);
      if (below(10) == 0) scope(1);
      if (below(12) == 0) loop();
      if (below(10) == 0) run_subroutine();
      if (below(12) == 0) call_if();
    }
    std::vector<trace::Write> results{{handed(0), any_mask()}};
    for (int i = 1; i < random_handed; ++i)
      if (below(3) > 0)  // numbers stay small, whatever is run how often
        results.push_back({handed(i), graph.operation(trace::Op::sine, any_of(numbers_))});
    graph.effect(results, "");
    graph.subroutines.clear();
    around.subroutines.push_back(std::make_shared<trace::Graph>(std::exchange(graph, {})));
    graph = around;
    numbers_.clear(), masks_.clear(), made_ = 0;
    left_.assign(random_handed, -1);
  }

  // Often with the numbers that a run before has left.
  void run_subroutine() {
    if (graph.subroutines.empty()) return;
    const int which = below(static_cast<int>(graph.subroutines.size()));
    std::vector<trace::Write> arguments{{handed(0), any_mask()}};
    for (int i = 1; i < random_handed; ++i)
      arguments.push_back({handed(i), below(2) && left_[i] >= 0 && is_known(left_[i]) ? left_[i] : any_of(numbers_)});
    std::vector<trace::Place> results;
    std::vector<bool> masks;
    for (const trace::Write& result : graph.subroutines[static_cast<std::size_t>(which)]->items().back().stores)
      if (below(4) > 0) results.push_back(result.place), masks.push_back(result.place.number == 0);
    const std::vector<trace::Id> after = graph.run(which, arguments, results, masks);
    for (std::size_t i = 0; i < after.size(); ++i) {
      (masks[i] ? masks_ : numbers_).push_back(after[i]);
      left_[results[i].number] = after[i];
    }
  }
  bool is_known(trace::Id id) const { return std::find(numbers_.begin(), numbers_.end(), id) != numbers_.end(); }

  std::mt19937_64 random_;
  std::vector<trace::Id> numbers_, masks_;
  std::vector<trace::Id> left_ = std::vector<trace::Id>(random_handed, -1);  // by number that is handed
  int made_ = 0;
};

}  // namespace lockstep::jit
