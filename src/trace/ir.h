// The intermediate representation of a step: nodes, loops and effects in order. SPDX-License-Identifier: Apache-2.0
//
// Equal nodes exist once. Each node is simplified when it is made, so what a model does not have leaves no operation:
// an offset of 0, an identity rotation.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "access.h"

namespace lockstep::trace {

enum class Op {
  constant,
  input,     // a number in memory
  variable,  // a number that a loop or an effect changes
  negate,
  add,
  subtract,
  multiply,
  divide,
  fma,
  fnma,
  sqrt,
  farther,  // the larger magnitude
  sine,
  cosine,
  by_precision,  // a number for f32, and one for f64
  // from here to invert: masks
  none,
  less,
  beyond,  // |a| > b
  either,
  both,
  invert,
  select,
};

using Id = int;

/// The place of a number in memory.
struct Place {
  std::string text;             ///< as a C++ expression
  int array = Access::nowhere;  ///< as in Access
  int number = 0;
  bool lasting = false;  ///< the number is the same in all steps of a call
  bool turns = false;    ///< except that hold() may change it
};

struct Node {
  Op op = Op::constant;
  std::array<Id, 3> operand{-1, -1, -1};
  double value = 0.0;   ///< of a constant
  double single = 0.0;  ///< by precision: in f32
  Place place;          ///< of an input
  int item = -1;        ///< its item in Graph::items, -1 for a constant
  bool mask = false;
};

/// `place = value`
struct Write {
  Place place;
  Id value;
};

/// A number that is added to a sum or subtracted. With a factor it is a product.
struct Addend {
  Id number, factor;
  bool minus;
};

/// A part of a step: straight-line nodes, a loop, an effect, or an end of a scope, whose items run where a lane needs
/// them.
struct Item {
  enum Kind { straight, loop, effect, begin_scope, end_scope };
  Kind kind = straight;
  std::vector<Id> nodes;
  // Numbers that a loop, an effect or a scope changes, and their values before it.
  std::vector<Id> variable, start;
  // A loop, or a scope, which runs at most so often.
  int times = 0;
  std::vector<Id> next;  ///< by variable: its value after a turn
  // A scope: it runs if a lane of `condition` is true, and again while one of `again` is.
  Id again = -1;
  bool unless = false;  ///< it runs if no lane of `condition` is true
  int other_end = -1;   ///< item
  // An effect: stores, then code. If it has a condition, the variables are stored too, and read again after the code.
  std::vector<Write> stores;
  std::string code;
  Call call = Call::none;  ///< the same as `code`, for machine code
  Id condition = -1;
  std::vector<Place> place;  ///< by variable
  // An effect that runs a subroutine: its stores are what that reads, its variables what that changes.
  int subroutine = -1;
};

class Graph {
 public:
  Id constant(double value);
  Id by_precision(double single, double twice);
  Id input(const Place& place, bool mask);
  Id operation(Op op, Id a = -1, Id b = -1, Id c = -1);

  /// Adds up the addends one by one. A product is rounded once, together with the sum.
  Id added_up(const std::vector<Addend>& addends);
  /// The product as an addend with a factor. If simplification left no product, the number itself.
  Addend apart(Id product, bool minus) const;
  /// a b if one of them is 1 or -1; else -1.
  Id times_one(Id a, Id b);
  /// The operand of a negation; any other node itself.
  Id without_sign(Id id) const { return is(id, Op::negate) ? nodes_[id].operand[0] : id; }

  /// Until end_loop(), nodes that depend on the variables belong to the loop. Returns the variables, one for each
  /// start.
  std::vector<Id> begin_loop(int times, const std::vector<Id>& start);
  /// Returns the variables' values after the last turn.
  std::vector<Id> end_loop(const std::vector<Id>& next);

  /// Until end_scope(), nodes belong to a scope, which runs if a lane of `condition` is true, or, with `unless`, if
  /// none is. Scopes nest. Returns variables, one for each start: the numbers in a turn that the turn before has
  /// changed.
  std::vector<Id> begin_scope(Id condition, bool unless = false, const std::vector<Id>& start = {});
  /// Adds variables to those of the scope: numbers that it changes, and their values before it. Returns the values of
  /// all of them behind the scope, which has run until no lane of `again` was true, at most so often.
  std::vector<Id> end_scope(const std::vector<Id>& more_starts, const std::vector<Id>& next, Id again = -1,
                            int times = 1);

  /// Stores and code, after all nodes so far and before all later ones.
  void effect(std::vector<Write> stores, const std::string& code, Call call = Call::none);
  /// Later nodes are not taken from those so far. Needed after code that changes memory or opens a scope.
  void forget();

  /// An effect under a condition. The code may change the numbers `changed`, which are stored before it. Returns their
  /// values after it.
  std::vector<Id> effect_if(Id condition, std::vector<Write> stores, const std::string& code, Call call,
                            const std::vector<Write>& changed);

  /// Stores the arguments and runs a subroutine, in a scope or outside, even one that calls stages. Returns the
  /// results: the numbers at these places behind it. `masks` tells which of them are masks.
  std::vector<Id> run(int subroutine, std::vector<Write> arguments, const std::vector<Place>& results,
                      const std::vector<bool>& masks);

  void name(Id id, const std::string& name);
  /// Whether the mask is true in all lanes, whatever their values, or in none.
  bool everywhere(Id mask) const;
  bool nowhere(Id mask) const { return is(mask, Op::none); }

  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<Item>& items() const { return items_; }
  std::vector<Item>& items() { return items_; }
  const std::map<Id, std::string>& names() const { return names_; }

  /// Graphs that this one runs, each from several places, or that those before them run. They read and write numbers
  /// that are handed to them (Access::handed).
  std::vector<std::shared_ptr<Graph>> subroutines;

 private:
  using Key = std::array<Id, 4>;
  using InputKey = std::tuple<int, int, std::string>;  // array, number, and text where there is no array
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t hash = 0;
      for (Id id : key) hash = (hash ^ static_cast<std::uint64_t>(id)) * 0x9e3779b97f4a7c15u;
      return hash ^ (hash >> 32);
    }
  };

  bool is_constant(Id id) const { return is(id, Op::constant) || is(id, Op::by_precision); }
  float single(Id constant) const;
  template <class Operation>
  Id folded(Operation operation, Id a, Id b);

  Id put(Node node);
  int item_of(const Node& node);
  Id variable(int item);
  Id find_or_put(Op op, Id a, Id b, Id c);
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
  Id selected(Id mask, Id yes, Id no);
  bool is(Id id, double value) const { return nodes_[id].op == Op::constant && nodes_[id].value == value; }
  bool is(Id id, Op op) const { return nodes_[id].op == op; }

  std::vector<Node> nodes_;
  std::vector<Item> items_;
  std::unordered_map<Key, Id, Hash> known_;
  std::map<InputKey, Id> inputs_;
  std::map<std::uint64_t, Id> constants_;  ///< by bits, as NaN has no order
  std::map<std::pair<std::uint64_t, std::uint64_t>, Id> by_precision_;
  std::map<Id, std::string> names_;
  /// A scope that is open, and what is known only within it.
  struct Scope {
    int begin;  ///< item
    std::unordered_map<Key, Id, Hash> known;
    std::map<InputKey, Id> inputs;
  };
  std::vector<Scope> scopes_;
  std::vector<std::pair<int, int>> closed_;  ///< items of scopes that have ended
  int open_loop_ = -1;                       ///< item
};

}  // namespace lockstep::trace
