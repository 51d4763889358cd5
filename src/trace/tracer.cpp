// What is recorded of a step: sums, scopes, subroutines, and what goes to memory around calls. SPDX-License-Identifier:
// Apache-2.0
#include "tracer.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "cost.h"
#include "liveness.h"
#include "simd/sincos.h"

namespace lockstep::trace {

using kernels::Lifetime;

namespace {

Id count(Op op) {
  switch (op) {
    case Op::add:
    case Op::subtract:
    case Op::multiply:
    case Op::divide:
    case Op::sqrt: counting->flops += 1; break;
    case Op::fma:
    case Op::fnma: counting->flops += 2; break;
    case Op::sine: counting->flops += simd::sincos_flops<float>; break;  // the cosine with it
    default: break;
  }
  return 0;
}

}  // namespace

Id trace_constant(double value) { return counting ? 0 : tracer->graph.constant(value); }
Id trace_by_precision(double single, double twice) { return counting ? 0 : tracer->graph.by_precision(single, twice); }
Id trace_operation(Op op, Id a, Id b, Id c) {
  if (counting) return count(op);
  if (std::min({a, b, c}) < -1) throw std::logic_error("traced code reads what a tile has no number for");
  switch (op) {
    case Op::add:
    case Op::subtract: return tracer->sum(op, a, b);
    case Op::fma:
    case Op::fnma: return tracer->product_and(op, a, b, c);
    default: return tracer->graph.operation(op, a, b, c);
  }
}
Id trace_as_it_stands(Op op, Id a, Id b, Id c) { return counting ? count(op) : tracer->graph.operation(op, a, b, c); }
Id trace_load(const double* p) {
  if (!counting) return tracer->load(p);
  counting->loaded.insert(p);
  return 0;
}
void trace_name(const void* place, Id id) {
  if (!counting) tracer->name(place, id);
}

void Tracer::add_rows(const double* first, int count, const std::string& name, int array) {
  rows_.push_back({first, count, name, array});
}

Id Tracer::sum(Op op, Id a, Id b) { return sum({a, b, -1, op == Op::subtract, stage_}, op, a, b, -1); }

Id Tracer::product_and(Op op, Id a, Id b, Id c) {
  if (const Id term = graph.times_one(a, b); term >= 0) return sum(op == Op::fma ? Op::add : Op::subtract, c, term);
  return sum({c, a, b, op == Op::fnma, stage_}, op, a, b, c);
}

Id Tracer::sum(const Sum& traced, Op op, Id a, Id b, Id c) {
  if (aside_) return graph.operation(op, a, b, c);
  const std::size_t number = sums_.size();
  sums_.push_back(traced);
  if (terms_ && number >= terms_->size()) throw std::logic_error("two tracings of a step have different sums");
  if (!terms_ || (*terms_)[number].empty()) return sums_.back().result = graph.operation(op, a, b, c);
  std::vector<Addend> addends;
  for (const Term& term : (*terms_)[number]) addends.push_back(addend(term));
  return sums_.back().result = graph.added_up(addends);
}

Addend Tracer::addend(const Term& term) const {
  const Sum& sum = sums_[static_cast<std::size_t>(term.sum)];
  if (term.second && sum.factor >= 0) return {sum.second, sum.factor, term.minus};
  const Id id = term.second ? sum.second : sum.first;
  return term.apart ? graph.apart(id, term.minus) : Addend{id, -1, term.minus};
}

void Tracer::know(Traced& number, Traced is) {
  const auto offset = reinterpret_cast<std::byte*>(&number) - block_.data();
  TileNumber& known = numbers_[static_cast<std::size_t>(number_at_[static_cast<std::size_t>(offset) / sizeof(Id)])];
  known.stored = number.id = is.id;
}

Id Tracer::load(const double* p) {
  for (const Rows& rows : rows_)
    if (p >= rows.first && p < rows.first + rows.count) {
      const int row = static_cast<int>(p - rows.first);
      const std::string text = row == 0 ? fmt::format("T::load(batch.{})", rows.name)
                                        : fmt::format("T::load(batch.{} + {} * batch.stride)", rows.name, row);
      return graph.input({text, rows.array, row, true}, false);
    }
  throw Error("a kernel", "reads a row of the batch that was not declared", "report this as a bug");
}

void Tracer::name(const void* place, Id id) {
  const auto offset = static_cast<const std::byte*>(place) - block_.data();
  if (offset < 0 || static_cast<std::size_t>(offset) >= used_) return;
  const int number = number_at_[static_cast<std::size_t>(offset) / sizeof(Id)];
  if (number >= 0) graph.name(id, numbers_[number].name);
}

template <class Wanted>
std::vector<Write> Tracer::changed(Wanted wanted) {
  std::vector<Write> stores;
  for (const TileNumber& number : numbers_)
    if (wanted(number) && *number.now != number.stored) stores.push_back({number.place, *number.now});
  return stores;
}

std::vector<Id> Tracer::numbers_now() const {
  std::vector<Id> now;
  for (const TileNumber& number : numbers_) now.push_back(*number.now);
  return now;
}

std::vector<std::size_t> Tracer::changed_since(const std::vector<Id>& before) const {
  std::vector<std::size_t> changed;
  for (std::size_t i = 0; i < numbers_.size(); ++i)
    if (*numbers_[i].now != before[i]) changed.push_back(i);
  return changed;
}

void Tracer::when(Id mask, bool unless, const std::function<void()>& body) {
  if (unless ? graph.everywhere(mask) : graph.nowhere(mask)) return;
  if (unless ? graph.nowhere(mask) : graph.everywhere(mask)) return body();
  graph.begin_scope(mask, unless);
  const std::vector<Id> before = numbers_now();
  body();
  std::vector<Id> start, next;
  const std::vector<std::size_t> changed = changed_since(before);
  for (std::size_t i : changed) start.push_back(before[i]), next.push_back(*numbers_[i].now);
  const std::vector<Id> after = graph.end_scope(start, next);
  for (std::size_t k = 0; k < changed.size(); ++k) *numbers_[changed[k]].now = after[k];
}

// A turn reads what the turn before has changed. Which numbers these are shows only when the body is traced, so it is
// traced until no further ones show.
void Tracer::repeat_while(Id& mask, int most, const std::function<void()>& body) {
  if (most <= 0 || graph.nowhere(mask)) return;
  std::vector<std::size_t> changed;
  for (;;) {
    const Graph graph_before = graph;
    const std::vector<Id> numbers_before = numbers_now();
    const Id mask_before = mask;
    std::vector<Id> start{mask};
    for (std::size_t i : changed) start.push_back(*numbers_[i].now);
    const std::vector<Id> variable = graph.begin_scope(mask, false, start);
    mask = variable[0];
    for (std::size_t k = 0; k < changed.size(); ++k) *numbers_[changed[k]].now = variable[k + 1];
    const std::vector<Id> at_begin = numbers_now();
    body();
    std::vector<std::size_t> all = changed_since(at_begin);
    all.insert(all.end(), changed.begin(), changed.end());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    if (all == changed) {
      std::vector<Id> next{mask};
      for (std::size_t i : changed) next.push_back(*numbers_[i].now);
      const std::vector<Id> after = graph.end_scope({}, next, mask, most);
      mask = after[0];
      for (std::size_t k = 0; k < changed.size(); ++k) *numbers_[changed[k]].now = after[k + 1];
      return;
    }
    graph = graph_before;
    for (std::size_t i = 0; i < numbers_.size(); ++i) *numbers_[i].now = numbers_before[i];
    mask = mask_before;
    changed = all;
  }
}

namespace {

Place handed(std::size_t number) {
  return {fmt::format("handed[{}]", number), Access::handed, static_cast<int>(number)};
}

}  // namespace

void Tracer::subroutine(const std::pair<const void*, std::string>& key, const std::function<void()>& body) {
  auto known = subroutines_.find(key);
  if (known == subroutines_.end()) known = subroutines_.emplace(key, trace_subroutine(body)).first;
  const Subroutine& own = known->second;
  std::vector<Write> arguments;
  for (std::size_t i : own.read) arguments.push_back({handed(i), *numbers_[i].now});
  std::vector<Place> results;
  std::vector<bool> masks;
  for (std::size_t i : own.changed) results.push_back(handed(i)), masks.push_back(numbers_[i].mask);
  const std::vector<Id> after = graph.run(own.number, std::move(arguments), results, masks);
  for (std::size_t k = 0; k < after.size(); ++k) {
    *numbers_[own.changed[k]].now = after[k];
    graph.name(after[k], numbers_[own.changed[k]].name);
  }
}

// Each number of the tile is handed to it, but for what is the same in all steps of a call: that is a constant, or in
// the tile's memory.
Tracer::Subroutine Tracer::trace_subroutine(const std::function<void()>& body) {
  Graph around = std::exchange(graph, {});
  const std::vector<Id> before = numbers_now();
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    TileNumber& number = numbers_[i];
    const Node& node = around.nodes()[*number.now];
    const bool lasts = number.lasts == Lifetime::call;
    if (lasts && node.op == Op::constant)
      *number.now = graph.constant(node.value);
    else if (lasts && node.op == Op::by_precision)
      *number.now = graph.by_precision(node.single, node.value);
    else
      *number.now = graph.input(lasts && *number.now == number.stored ? number.place : handed(i), number.mask);
    graph.name(*number.now, number.name);
  }
  const std::vector<Id> inputs = numbers_now();
  body();
  Subroutine made{static_cast<int>(graphs_.size()), {}, changed_since(inputs)};
  std::vector<Write> results;
  for (std::size_t i : made.changed) results.push_back({handed(i), *numbers_[i].now});
  graph.effect(std::move(results), "");
  const std::vector<int> uses = use_counts(graph);
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const Node& node = graph.nodes()[inputs[i]];
    if (node.op == Op::input && node.place.array == Access::handed && uses[inputs[i]] > 0) made.read.push_back(i);
    *numbers_[i].now = before[i];
  }
  graphs_.push_back(std::make_shared<Graph>(std::exchange(graph, std::move(around))));
  return made;
}

Graph Tracer::take_graph() {
  graph.subroutines = std::move(graphs_);
  drop_unread_results(graph);
  return std::move(graph);
}

void Tracer::run(const std::string& code, Call call) {
  if (learns_ && call != Call::none) return leave_out();
  graph.effect(changed(&Tracer::is_shared), code, call);
  graph.forget();
  for (TileNumber& number : numbers_)
    if (is_shared(number)) read(number);
}

void Tracer::run_if(Id condition, std::vector<Write> stores, const std::string& code, Call call,
                    const std::set<const void*>& ends) {
  std::vector<Write> before;
  std::vector<TileNumber*> end_numbers;
  for (TileNumber& number : numbers_) {
    if (!ends.contains(number.array ? number.array : number.now)) continue;
    before.push_back({number.place, *number.now});
    end_numbers.push_back(&number);
  }
  const std::vector<Id> after = graph.effect_if(condition, std::move(stores), code, call, before);
  for (std::size_t i = 0; i < after.size(); ++i) {
    *end_numbers[i]->now = after[i];
    graph.name(after[i], end_numbers[i]->name);
  }
}

Place Tracer::place_of_candidates() const {
  for (const TileNumber& number : numbers_)
    if (number.now == &tile_.bounds.candidate.id) return number.place;
  throw std::logic_error("a traced tile has no mask of candidates");
}

void Tracer::hold_if(Id condition, Id failed, bool turns, bool audits) {
  std::vector<Write> flags;
  for (const TileNumber& number : numbers_)
    if (!number.array && number.lasts != Lifetime::stage) flags.push_back({number.place, *number.now});
  flags.push_back({{"const typename T::Mask failed", Access::failed}, failed});
  std::set<const void*> ends = {tile_.next.q, tile_.next.v, tile_.next.pose};
  if (turns) ends.insert(&tile_.frozen.id);    // a lane may lose count
  if (audits) ends.insert(tile_.audit.state);  // the reason of a fault, and what is known if a joint has turned
  run_if(condition, std::move(flags), "hold(t, batch, x, failed);", Call::hold, ends);
}

void Tracer::solve_bounds_if(Id candidate, const std::set<const void*>& unread) {
  const std::set<const void*> ends = {tile_.next.q, tile_.next.v, tile_.next.pose, tile_.half_turn};
  std::vector<Write> stores = changed([&](const TileNumber& number) {
    return is_shared(number) && !(number.array && (ends.contains(number.array) || unread.contains(number.array)));
  });
  stores.push_back({place_of_candidates(), candidate});
  run_if(candidate, std::move(stores), "solve_bounds(t, batch, x);", Call::solve_bounds, ends);
}

void Tracer::step_again_if(Id candidate) {
  run_if(candidate, {{place_of_candidates(), candidate}}, "step_again(t, batch, x);", Call::step_again,
         {tile_.next.q, tile_.next.v, tile_.next.pose, &tile_.singular.id, &tile_.too_fast.id});
}

void Tracer::halves_if(Id coarse, int depth) {
  std::vector<Write> stores{{place_of_candidates(), coarse}};
  const std::set<const void*> begin = {tile_.stages.begin.q, tile_.stages.begin.v, tile_.stages.begin.pose};
  for (const TileNumber& number : numbers_)
    if (number.array && begin.contains(number.array)) stores.push_back({number.place, *number.now});
  run_if(coarse, std::move(stores), fmt::format("halve_again(t, batch, {}, x);", depth),
         depth == 0 ? Call::halves : Call::quarters,
         {tile_.next.q, tile_.next.v, tile_.next.pose, &tile_.singular.id, &tile_.too_fast.id});
}

void Tracer::audit_if(Id fast) {
  run_if(fast, {{{"x.audit.fast"}, fast}}, "x.audit.state->known = T::none();\naudit(t, batch, x);", Call::none,
         {tile_.next.q, tile_.next.v, tile_.next.pose, tile_.audit.state, &tile_.too_fast.id});
}

void Tracer::end_routine() {
  graph.effect(changed([](const TileNumber& number) { return is_shared(number) || !number.array; }), "");
}

void Tracer::keep_state() {
  const auto is_state = [](const TileNumber& number) { return number.lasts == Lifetime::state; };
  graph.effect(changed(is_state), "");
  for (TileNumber& number : numbers_)
    if (is_state(number)) number.stored = *number.now;
}

}  // namespace lockstep::trace
