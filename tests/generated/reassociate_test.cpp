// The order of the terms of a sum, and which terms it takes over from others. SPDX-License-Identifier: Apache-2.0
#include "trace/reassociate.h"

#include <gtest/gtest.h>

#include <string>

namespace lockstep::trace {
namespace {

// A step that stores a few sums of four inputs.
struct Step : Tracing {
  int stage = 0;
  Id w = input("w"), x = input("x"), y = input("y"), z = input("z");

  Id input(const char* name) { return graph.input({name}, false); }
  Id add(Id a, Id b) { return sum(Op::add, a, b); }
  Id subtract(Id a, Id b) { return sum(Op::subtract, a, b); }
  Id multiply(Id a, Id b) { return graph.operation(Op::multiply, a, b); }
  Id divide(Id a, Id b) { return graph.operation(Op::divide, a, b); }
  Id fma(Id a, Id b, Id c) {
    sums.push_back({c, a, b, false, stage, graph.operation(Op::fma, a, b, c)});
    return sums.back().result;
  }
  Id sum(Op op, Id a, Id b) {
    sums.push_back({a, b, -1, op == Op::subtract, stage, graph.operation(op, a, b)});
    return sums.back().result;
  }
  Step& store(Id result) {
    graph.effect({{{"result"}, result}}, "");
    return *this;
  }
};

std::string text(const Graph& graph, Id id) {
  const Node& node = graph.nodes()[id];
  const auto of = [&](int i) { return text(graph, node.operand[i]); };
  switch (node.op) {
    case Op::input: return node.place.text;
    case Op::multiply: return of(0) + of(1);
    case Op::divide: return of(0) + "/" + of(1);
    default: return "(sum)";
  }
}

// The terms of the sum in the order in which they are added up.
std::string terms(const Step& any, const Step& consistent, int sum) {
  std::string all;
  const auto found = terms_of(any, consistent);
  for (const Term& term : found[sum]) {
    const Sum& of = any.sums[term.sum];
    const Id id = term.second ? of.second : of.first;
    all += term.minus ? " - " : " + ";
    all += text(any.graph, id) + (term.second && of.factor >= 0 ? text(any.graph, of.factor) : "");
  }
  return all;
}
std::string terms(const Step& step, int sum) { return terms(step, step, sum); }

TEST(Reassociate, merges_terms_that_are_used_once) {
  Step s;
  s.store(s.add(s.subtract(s.z, s.add(s.multiply(s.w, s.x), s.y)), s.x));
  EXPECT_EQ(terms(s, 0), "");
  EXPECT_EQ(terms(s, 1), "");
  EXPECT_EQ(terms(s, 2), " + z - wx - y + x");
}

TEST(Reassociate, keeps_numbers_that_are_used_twice) {
  Step s;
  const Id shared = s.add(s.x, s.y), product = s.multiply(s.w, s.x);
  s.store(s.add(shared, s.z)).store(shared).store(s.subtract(product, s.y)).store(product);
  EXPECT_EQ(terms(s, 0), " + x + y");
  EXPECT_EQ(terms(s, 1), " + z + (sum)");
  const auto found = terms_of(s, s);
  EXPECT_FALSE(found[2][0].apart || found[2][1].apart);
}

// A call may change the terms of a sum.
TEST(Reassociate, keeps_sums_that_were_made_before_a_call) {
  Step s;
  const Id before = s.add(s.x, s.y);
  ++s.stage;
  s.store(s.add(before, s.z));
  EXPECT_EQ(terms(s, 1), " + z + (sum)");
}

TEST(Reassociate, adds_late_terms_last) {
  Step s;
  s.store(s.add(s.add(s.add(s.divide(s.x, s.y), s.y), s.multiply(s.w, s.x)), s.z));
  EXPECT_EQ(terms(s, 2), " + y + wx + z + x/y");
}

TEST(Reassociate, orders_terms_by_when_their_reordered_sums_are_known) {
  Step s;
  // As traced, `first` is known two cycles after `second`. Once its terms are reordered, it is known one cycle before.
  const Id first = s.add(s.add(s.divide(s.x, s.y), s.x), s.y);
  const Id second = s.fma(s.w, s.x, s.divide(s.y, s.x));
  s.store(s.add(s.add(second, s.z), first)).store(first).store(second);
  EXPECT_EQ(terms(s, 4), " + z + (sum) + (sum)");
  EXPECT_EQ(terms_of(s, s)[4][1].sum, 4);  // `first`, an operand of sum 4; `second` comes from sum 3
}

TEST(Reassociate, begins_with_a_number_where_it_can) {
  Step s;
  s.store(s.fma(s.w, s.x, s.divide(s.y, s.z)));
  EXPECT_EQ(terms(s, 0), " + y/z + wx");
}

// Both traces of a step must round alike. In tiles with consistent followers two sums may be the same number, which is
// then used twice and stays separate. So it stays separate in the trace of any tile, too.
TEST(Reassociate, keeps_sums_separate_that_the_other_trace_uses_twice) {
  const auto step = [](bool consistent) {
    Step s;
    const Id one = s.add(s.x, s.y), other = s.add(s.x, consistent ? s.y : s.w);
    s.store(s.add(one, s.z)).store(s.add(other, s.multiply(s.z, s.z)));
    return s;
  };
  const Step any = step(false), consistent = step(true);
  EXPECT_EQ(terms(any, any, 2), " + x + y + z");
  EXPECT_EQ(terms(any, consistent, 2), " + z + (sum)");
  EXPECT_EQ(terms(any, consistent, 3), " + (sum) + zz");
}

}  // namespace
}  // namespace lockstep::trace
