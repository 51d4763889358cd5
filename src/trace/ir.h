// What a step does to numbers, written down: nodes, loops, stores, in order. SPDX-License-Identifier: Apache-2.0
//
// Nodes are made once (equal ones are found again) and simplified as they are made: what a model has not - an offset
// of 0, a rotation by nothing - leaves no operation behind.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "access.h"

namespace lockstep::trace {

enum class Op {
  constant,
  input,
  variable,  // a number; what stands in memory; what a loop changes
  negate,
  add,
  subtract,
  multiply,
  divide,
  fma,
  fnma,
  sqrt,
  farther,
  sine,
  cosine,
  rounding,
  none,
  less,
  beyond,
  either,
  both,
  invert,  // masks
  select,
};

using Id = int;

/// Where a number stands in memory.
struct Place {
  std::string text;             ///< how C++ says it
  int array = Access::nowhere;  ///< as in Access
  int number = 0;
  bool lasting = false;  ///< the same in all steps of a call
};

struct Node {
  Op op = Op::constant;
  std::array<Id, 3> operand{-1, -1, -1};
  double value = 0.0;  ///< of a constant
  Place place;         ///< of an input
  int item = -1;       ///< where in Graph::items it stands; a constant stands nowhere
  bool mask = false;
};

/// `place = value`
struct Write {
  Place place;
  Id value;
};

/// What is added to a sum, or subtracted: a number or, with a factor, a product.
struct Addend {
  Id number, factor;
  bool minus;
};

/// A part of a step, in order: some nodes, and what is done behind them.
struct Item {
  enum Kind { straight, loop, effect };
  Kind kind = straight;
  std::vector<Id> nodes;
  // what it changes of numbers: their values before, and after
  std::vector<Id> variable, start;
  // loop
  int times = 0;
  std::vector<Id> next;  ///< by variable, after each turn
  // effect: stores, then code; under a condition if there is one, and then variables are read again
  std::vector<Write> stores;
  std::string code;
  Call call = Call::none;  ///< the code, for those who cannot read it
  Id condition = -1;
  std::vector<Place> place;  ///< by variable
};

class Graph {
 public:
  Id constant(double value);
  Id input(const Place& place, bool mask);
  Id operation(Op op, Id a = -1, Id b = -1, Id c = -1);

  /// One by one, each product rounded once with the sum.
  Id added_up(const std::vector<Addend>& addends);
  /// A product's factors; itself where it is none after all.
  Addend apart(Id product, bool minus) const;
  /// a b where one of them is 1 or -1, -1 if none is.
  Id times_one(Id a, Id b);
  /// The same but for its sign.
  Id without_sign(Id id) const { return is(id, Op::negate) ? nodes_[id].operand[0] : id; }

  /// From here on nodes that depend on the variables are the loop's body. Returns the variables, one for each start.
  std::vector<Id> begin_loop(int times, const std::vector<Id>& start);
  /// Returns what the variables are after the last turn.
  std::vector<Id> end_loop(const std::vector<Id>& next);

  /// Stores and code that stand between the nodes before and those to come. Where the code may change memory
  /// or open a scope, nodes from before are not found again.
  void effect(std::vector<Write> stores, const std::string& code, Call call = Call::none);
  void forget();

  /// Under a condition: stores, these numbers too, and code that changes them. Returns what they are afterwards.
  std::vector<Id> effect_if(Id condition, std::vector<Write> stores, const std::string& code, Call call,
                            const std::vector<Write>& changed);

  void name(Id id, const std::string& name);

  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<Item>& items() const { return items_; }
  const std::map<Id, std::string>& names() const { return names_; }

 private:
  using Key = std::array<Id, 4>;
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t hash = 0;
      for (Id id : key) hash = (hash ^ static_cast<std::uint64_t>(id)) * 0x9e3779b97f4a7c15u;
      return hash ^ (hash >> 32);
    }
  };

  Id put(Node node);
  Id variable(int item);
  Id found_or_put(Op op, Id a, Id b, Id c);
  Id negated(Id a);
  Id sum(Id a, Id b);
  Id difference(Id a, Id b);
  Id product(Id a, Id b);
  Id quotient(Id a, Id b);
  Id product_and(Op op, Id a, Id b, Id c);
  Id compared(Id a, Id b);
  Id of_masks(Op op, Id a, Id b);
  bool is_among(Op op, Id mask, Id all) const;
  Id inverted(Id mask);
  bool everywhere(Id mask) const;
  Id selected(Id mask, Id yes, Id no);
  bool is(Id id, double value) const { return nodes_[id].op == Op::constant && nodes_[id].value == value; }
  bool is(Id id, Op op) const { return nodes_[id].op == op; }

  std::vector<Node> nodes_;
  std::vector<Item> items_;
  std::unordered_map<Key, Id, Hash> known_;
  std::map<std::string, Id> inputs_;
  std::map<double, Id> constants_;
  std::map<Id, std::string> names_;
  int open_loop_ = -1;  ///< item
};

}  // namespace lockstep::trace
