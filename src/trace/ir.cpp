// How the graph is built: equal nodes are found, and operations simplified. SPDX-License-Identifier: Apache-2.0
#include "ir.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <stdexcept>

namespace lockstep::trace {

Id Graph::put(Node node) {
  for (Id o : node.operand)
    if (o >= 0 && nodes_[o].item >= 0 && nodes_[o].item != open_loop_ && items_[nodes_[o].item].kind == Item::loop)
      throw std::logic_error("a kernel reads a number of a loop that the loop does not carry: see kernels::repeat");
  for (Id o : node.operand)
    for (const auto& [begin, end] : closed_)
      if (o >= 0 && nodes_[o].item >= begin && nodes_[o].item < end)
        throw std::logic_error("a kernel reads a number of a scope that has ended: see kernels::when");
  const bool inside = open_loop_ >= 0 && std::any_of(node.operand.begin(), node.operand.end(),
                                                     [&](Id o) { return o >= 0 && nodes_[o].item == open_loop_; });
  node.item = inside ? open_loop_ : item_of(node);
  const Id id = static_cast<Id>(nodes_.size());
  items_[node.item].nodes.push_back(id);
  nodes_.push_back(std::move(node));
  return id;
}

// Where a node outside of loops belongs: behind all that it depends on, and not behind a loop on which it does not. So
// loops of other trees do not decide which sums are inner sums.
int Graph::item_of(const Node& node) {
  int behind = -1;  // the last item that the node must follow
  int in = -1;      // the last straight one that it may be in
  for (Id o : node.operand) {
    if (o < 0) continue;
    const int item = is(o, Op::variable) && nodes_[o].item < 0 ? nodes_[nodes_[o].operand[0]].item : nodes_[o].item;
    if (item < 0) continue;
    int& last = items_[item].kind == Item::straight ? in : behind;
    last = std::max(last, item);
  }
  if (node.op == Op::input) behind = static_cast<int>(items_.size()) - 1;  // memory as it is now
  if (!scopes_.empty()) behind = std::max(behind, scopes_.back().begin);
  for (const auto& [begin, end] : closed_)
    if (behind >= begin && behind < end) behind = end;
  if (open_loop_ >= 0) behind = std::min(behind, open_loop_ - 1);
  int item = std::max(in, behind);
  if (item >= 0 && items_[item].kind == Item::straight) return item;
  while (++item < static_cast<int>(items_.size())) {
    if (items_[item].kind == Item::begin_scope && items_[item].other_end >= 0) item = items_[item].other_end;
    if (items_[item].kind == Item::straight) return item;
  }
  items_.emplace_back();
  return static_cast<int>(items_.size()) - 1;
}

Id Graph::constant(double value) {
  if (value == 0.0) value = 0.0;  // not -0
  const auto [known, is_new] = constants_.try_emplace(std::bit_cast<std::uint64_t>(value), 0);
  if (is_new) {
    Node node;
    node.op = Op::constant;
    node.value = value;
    known->second = static_cast<Id>(nodes_.size());
    nodes_.push_back(node);
  }
  return known->second;
}

// What a constant is in f32.
float Graph::single(Id id) const {
  return static_cast<float>(is(id, Op::constant) ? nodes_[id].value : nodes_[id].single);
}

// The operation on two constants, rounded as each precision rounds it: a number that is a constant only for consistent
// followers is computed by a step of other ones.
template <class Operation>
Id Graph::folded(Operation operation, Id a, Id b) {
  return by_precision(operation(single(a), single(b)), operation(nodes_[a].value, nodes_[b].value));
}

Id Graph::by_precision(double single, double twice) {
  const auto bits = [](double number) { return std::bit_cast<std::uint64_t>(number); };
  const double cast = static_cast<float>(twice);
  if (bits(single) == bits(cast)) return constant(twice);
  const auto [known, is_new] = by_precision_.try_emplace({bits(single), bits(twice)}, 0);
  if (is_new) {
    Node node;
    node.op = Op::by_precision;
    node.value = twice, node.single = single;
    known->second = static_cast<Id>(nodes_.size());
    nodes_.push_back(node);
  }
  return known->second;
}

Id Graph::input(const Place& place, bool mask) {
  // Places that only text tells apart are those of no array.
  const bool named = place.array == Access::nowhere;
  const auto [known, is_new] = inputs_.try_emplace({place.array, place.number, named ? place.text : std::string()}, 0);
  if (is_new) {
    Node node;
    node.op = Op::input;
    node.place = place;
    node.mask = mask;
    known->second = put(std::move(node));
  }
  return known->second;
}

Id Graph::find_or_put(Op op, Id a, Id b, Id c) {
  const bool commutes =
      op == Op::add || op == Op::multiply || op == Op::fma || op == Op::fnma || op == Op::either || op == Op::both;
  const auto rank = [&](Id id) { return is(id, Op::constant) ? -1 : id; };
  if (commutes && rank(b) < rank(a)) std::swap(a, b);
  const Key key{static_cast<Id>(op), a, b, c};
  if (const auto known = known_.find(key); known != known_.end()) return known->second;
  Node node;
  node.op = op;
  node.operand = {a, b, c};
  node.mask =
      op == Op::none || op == Op::less || op == Op::beyond || op == Op::either || op == Op::both || op == Op::invert;
  const Id id = put(std::move(node));
  known_.emplace(key, id);
  return id;
}

Id Graph::negated(Id a) {
  const auto [of, from, none] = nodes_[a].operand;
  switch (nodes_[a].op) {
    case Op::constant: return constant(-nodes_[a].value);
    case Op::by_precision: return by_precision(-nodes_[a].single, -nodes_[a].value);
    case Op::negate: return of;
    case Op::subtract: return difference(from, of);
    default: return find_or_put(Op::negate, a, -1, -1);
  }
}

Id Graph::sum(Id a, Id b) {
  if (is_constant(a) && is_constant(b)) return folded(std::plus(), a, b);
  if (is(a, 0.0)) return b;
  if (is(b, 0.0)) return a;
  if (is(b, Op::negate)) return difference(a, nodes_[b].operand[0]);
  if (is(a, Op::negate)) return difference(b, nodes_[a].operand[0]);
  if (is(b, Op::constant)) std::swap(a, b);
  return find_or_put(Op::add, a, b, -1);
}

Id Graph::difference(Id a, Id b) {
  if (is_constant(a) && is_constant(b)) return folded(std::minus(), a, b);
  if (is(b, 0.0)) return a;
  if (is(a, 0.0)) return negated(b);
  if (a == b) return constant(0.0);
  if (is(b, Op::negate)) return sum(a, nodes_[b].operand[0]);
  if (is(a, Op::negate)) return negated(sum(nodes_[a].operand[0], b));
  return find_or_put(Op::subtract, a, b, -1);
}

Id Graph::product(Id a, Id b) {
  if (is_constant(a) && is_constant(b)) return folded(std::multiplies(), a, b);
  if (is(b, Op::constant)) std::swap(a, b);
  if (is(a, 0.0)) return a;
  if (is(a, 1.0)) return b;
  if (is(a, -1.0)) return negated(b);
  if (is(a, Op::negate)) return negated(product(nodes_[a].operand[0], b));
  if (is(b, Op::negate)) return negated(product(a, nodes_[b].operand[0]));
  if (is(a, Op::constant) && nodes_[a].value < 0.0) return negated(product(constant(-nodes_[a].value), b));
  return find_or_put(Op::multiply, a, b, -1);
}

Id Graph::quotient(Id a, Id b) {
  if (is_constant(a) && is_constant(b)) return folded(std::divides(), a, b);
  if (is(b, 1.0) || is(a, 0.0)) return a;
  if (is_constant(b)) return product(a, folded(std::divides(), constant(1.0), b));
  if (is(a, Op::negate)) return negated(quotient(nodes_[a].operand[0], b));
  if (is(b, Op::negate)) return negated(quotient(a, nodes_[b].operand[0]));
  return find_or_put(Op::divide, a, b, -1);
}

Id Graph::times_one(Id a, Id b) {
  if (is(b, Op::constant)) std::swap(a, b);
  return is(a, 1.0) ? b : is(a, -1.0) ? negated(b) : -1;
}

// fma: a b + c, fnma: c - a b
Id Graph::product_and(Op op, Id a, Id b, Id c) {
  const Op other = op == Op::fma ? Op::fnma : Op::fma;
  if (is(b, Op::constant)) std::swap(a, b);
  if (is(a, 0.0)) return c;
  const bool needs_no_fma = is(c, 0.0) || is(a, 1.0) || is(a, -1.0);
  if (needs_no_fma) return op == Op::fma ? sum(c, product(a, b)) : difference(c, product(a, b));
  if (is(a, Op::negate)) return product_and(other, nodes_[a].operand[0], b, c);
  if (is(b, Op::negate)) return product_and(other, a, nodes_[b].operand[0], c);
  if (is(a, Op::constant) && nodes_[a].value < 0.0) return product_and(other, constant(-nodes_[a].value), b, c);
  if (op == Op::fnma && is(c, Op::negate)) return negated(product_and(Op::fma, a, b, nodes_[c].operand[0]));
  return find_or_put(op, a, b, c);
}

Id Graph::added_up(const std::vector<Addend>& addends) {
  const bool negative = addends.front().minus;  // then a sum and its negative share their nodes
  Id all = constant(0.0);
  for (const auto& [number, factor, minus] : addends) {
    if (factor >= 0)
      all = product_and(minus == negative ? Op::fma : Op::fnma, number, factor, all);
    else
      all = minus == negative ? sum(all, number) : difference(all, number);
  }
  return negative ? negated(all) : all;
}

Addend Graph::apart(Id product, bool minus) const {
  const Id id = without_sign(product);
  if (!is(id, Op::multiply)) return {product, -1, minus};
  return {nodes_[id].operand[0], nodes_[id].operand[1], minus != (id != product)};
}

bool Graph::everywhere(Id mask) const { return is(mask, Op::invert) && is(nodes_[mask].operand[0], Op::none); }

Id Graph::inverted(Id mask) {
  if (is(mask, Op::invert)) return nodes_[mask].operand[0];
  return find_or_put(Op::invert, mask, -1, -1);
}

Id Graph::of_masks(Op op, Id a, Id b) {
  const auto neutral = [&](Id mask) { return op == Op::either ? is(mask, Op::none) : everywhere(mask); };
  const auto decisive = [&](Id mask) { return op == Op::both ? is(mask, Op::none) : everywhere(mask); };
  if (neutral(a) || decisive(b) || is_among(op, a, b)) return b;
  if (neutral(b) || decisive(a) || is_among(op, b, a)) return a;
  return find_or_put(op, a, b, -1);
}

// Whether `mask` is an operand of `all`, directly or through further operations of the same kind.
bool Graph::is_among(Op op, Id mask, Id all) const {
  if (all <= mask || !is(all, op)) return all == mask;
  const auto& [left, right, unused] = nodes_[all].operand;
  return is_among(op, mask, left) || is_among(op, mask, right);
}

Id Graph::compared(Id a, Id b) {
  const bool both = is_constant(a) && is_constant(b);
  const bool is_less = both && nodes_[a].value < nodes_[b].value;
  if (!both || is_less != (single(a) < single(b))) return find_or_put(Op::less, a, b, -1);
  const Id nowhere = operation(Op::none);
  return is_less ? inverted(nowhere) : nowhere;
}

Id Graph::selected(Id mask, Id yes, Id no) {
  if (yes == no || is(mask, Op::none)) return no;
  if (everywhere(mask)) return yes;
  return find_or_put(Op::select, mask, yes, no);
}

Id Graph::operation(Op op, Id a, Id b, Id c) {
  switch (op) {
    case Op::negate: return negated(a);
    case Op::add: return sum(a, b);
    case Op::subtract: return difference(a, b);
    case Op::multiply: return product(a, b);
    case Op::divide: return quotient(a, b);
    case Op::fma:
    case Op::fnma: return product_and(op, a, b, c);
    case Op::either:
    case Op::both: return of_masks(op, a, b);
    case Op::select: return selected(a, b, c);
    case Op::less: return compared(a, b);
    case Op::invert: return inverted(a);
    case Op::farther:  // of magnitudes, which consistent followers may share with their leaders
      b = without_sign(b);
      for (Id most = a; is(most, Op::farther); most = nodes_[most].operand[0])
        if (nodes_[most].operand[1] == b) return a;
      return find_or_put(op, a, b, c);
    case Op::sine:
    case Op::cosine:
      if (!is(a, Op::negate)) return find_or_put(op, a, b, c);
      a = operation(op, nodes_[a].operand[0]);
      return op == Op::sine ? negated(a) : a;
    case Op::sqrt:
      if (is_constant(a)) return folded([](auto x, auto) { return std::sqrt(x); }, a, a);
      return find_or_put(op, a, b, c);
    default: return find_or_put(op, a, b, c);
  }
}

std::vector<Id> Graph::begin_loop(int times, const std::vector<Id>& start) {
  if (items_.empty() || items_.back().kind != Item::straight) items_.emplace_back();
  open_loop_ = static_cast<int>(items_.size());
  Item& loop = items_.emplace_back();
  loop.kind = Item::loop;
  loop.times = times;
  loop.start = start;
  for (std::size_t i = 0; i < start.size(); ++i) items_[open_loop_].variable.push_back(variable(open_loop_));
  return items_[open_loop_].variable;
}

Id Graph::variable(int item) {
  Node node;
  node.op = Op::variable;
  node.item = item;
  nodes_.push_back(node);
  return static_cast<Id>(nodes_.size()) - 1;
}

std::vector<Id> Graph::end_loop(const std::vector<Id>& next) {
  Item& loop = items_[open_loop_];
  loop.next = next;
  open_loop_ = -1;
  // New nodes with the variables' names: nodes that were computed from the old ones belong to a turn of the loop.
  std::vector<Id> after;
  for (Id variable : loop.variable) {
    Node node;
    node.op = Op::variable;
    node.operand[0] = variable;
    after.push_back(static_cast<Id>(nodes_.size()));
    nodes_.push_back(node);
  }
  return after;
}

std::vector<Id> Graph::begin_scope(Id condition, bool unless, const std::vector<Id>& start) {
  const int begin = static_cast<int>(items_.size());
  Item& item = items_.emplace_back();
  item.kind = Item::begin_scope;
  item.condition = condition;
  item.unless = unless;
  item.start = start;
  for (Id id : start) {
    const Id put = variable(begin);
    nodes_[put].mask = nodes_[id].mask;
    items_[begin].variable.push_back(put);
  }
  scopes_.push_back({begin, known_, inputs_});
  return items_[begin].variable;
}

std::vector<Id> Graph::end_scope(const std::vector<Id>& more_starts, const std::vector<Id>& next, Id again, int times) {
  const int begin = scopes_.back().begin, end = static_cast<int>(items_.size());
  for (Id id : more_starts) {
    const Id put = variable(begin);
    nodes_[put].mask = nodes_[id].mask;
    items_[begin].start.push_back(id);
    items_[begin].variable.push_back(put);
  }
  items_[begin].next = next;
  items_[begin].again = again;
  items_[begin].times = times;
  items_[begin].other_end = end;
  Item& item = items_.emplace_back();
  item.kind = Item::end_scope;
  item.other_end = begin;
  known_ = std::move(scopes_.back().known);
  inputs_ = std::move(scopes_.back().inputs);
  scopes_.pop_back();
  closed_.push_back({begin, end});
  std::vector<Id> after;
  for (Id changed : items_[begin].variable) {
    Node node;
    node.op = Op::variable;
    node.operand[0] = changed;
    node.item = end;
    node.mask = nodes_[changed].mask;
    after.push_back(static_cast<Id>(nodes_.size()));
    nodes_.push_back(node);
  }
  return after;
}

void Graph::effect(std::vector<Write> stores, const std::string& code, Call call) {
  if (!scopes_.empty()) throw std::logic_error("a scope changes memory or calls a stage");
  Item& item = items_.emplace_back();
  item.kind = Item::effect;
  item.stores = std::move(stores);
  item.code = code;
  item.call = call;
}

std::vector<Id> Graph::effect_if(Id condition, std::vector<Write> stores, const std::string& code, Call call,
                                 const std::vector<Write>& changed) {
  effect(std::move(stores), code, call);
  Item& item = items_.back();
  item.condition = condition;
  for (const Write& store : changed) {
    item.variable.push_back(variable(static_cast<int>(items_.size()) - 1));
    nodes_[item.variable.back()].mask = nodes_[store.value].mask;
    item.start.push_back(store.value);
    item.place.push_back(store.place);
  }
  return item.variable;
}

std::vector<Id> Graph::run(int subroutine, std::vector<Write> arguments, const std::vector<Place>& results,
                           const std::vector<bool>& masks) {
  const int number = static_cast<int>(items_.size());
  Item& item = items_.emplace_back();
  item.kind = Item::effect;
  item.subroutine = subroutine;
  item.stores = std::move(arguments);
  item.place = results;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Id put = variable(number);
    nodes_[put].mask = masks[i];
    items_[number].variable.push_back(put);
  }
  return items_[number].variable;
}

void Graph::forget() {
  known_.clear();
  inputs_.clear();
}

void Graph::name(Id id, const std::string& name) {
  if (!is(id, Op::constant)) names_.try_emplace(id, name);
}

}  // namespace lockstep::trace
