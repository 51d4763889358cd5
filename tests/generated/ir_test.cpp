// How a trace simplifies operations, and how code is emitted and split. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <regex>
#include <set>
#include <sstream>

#include <stdexcept>

#include "codegen/emit_cpp.h"

namespace lockstep::trace {
namespace {

// The expression of the one line of code that stores f(x, y, z).
template <class F>
std::string emitted(F f) {
  Graph graph;
  const Id x = graph.input({"x"}, false), y = graph.input({"y"}, false), z = graph.input({"z"}, false);
  for (const Id id : {x, y, z}) graph.name(id, graph.nodes()[id].place.text + std::string("_0"));
  const Id result = f(graph, x, y, z);
  graph.effect({{{"result"}, result}}, "");
  const std::string code = codegen::emit_cpp(graph).code();
  const std::size_t at = code.find("result = ");
  return code.substr(at + 9, code.find(';', at) - at - 9);
}

TEST(Graph, drops_operations_that_change_nothing) {
  const auto with = [](double number, Op op) {
    return emitted([=](Graph& g, Id x, Id, Id) { return g.operation(op, x, g.constant(number)); });
  };
  EXPECT_EQ(with(0.0, Op::add), "x_0");
  EXPECT_EQ(with(0.0, Op::subtract), "x_0");
  EXPECT_EQ(with(1.0, Op::multiply), "x_0");
  EXPECT_EQ(with(-1.0, Op::multiply), "-x_0");
  EXPECT_EQ(with(0.0, Op::multiply), "n(0)");
  EXPECT_EQ(with(1.0, Op::divide), "x_0");
  EXPECT_EQ(emitted([](Graph& g, Id x, Id y, Id) { return g.operation(Op::fma, x, g.constant(0.0), y); }), "y_0");
  EXPECT_EQ(emitted([](Graph& g, Id x, Id y, Id) { return g.operation(Op::fnma, g.constant(1.0), x, y); }),
            "y_0 - x_0");
  EXPECT_EQ(emitted([](Graph& g, Id x, Id y, Id) {
              return g.operation(Op::select, g.operation(Op::less, g.constant(1.0), g.constant(2.0)), x, y);
            }),
            "x_0");
}

TEST(Graph, folds_negations_into_other_operations) {
  EXPECT_EQ(emitted([](Graph& g, Id x, Id y, Id z) { return g.operation(Op::fma, g.operation(Op::negate, x), y, z); }),
            "fnma(x_0, y_0, z_0)");
  EXPECT_EQ(emitted([](Graph& g, Id x, Id y, Id) { return g.operation(Op::add, x, g.operation(Op::negate, y)); }),
            "x_0 - y_0");
  EXPECT_EQ(emitted([](Graph& g, Id x, Id y, Id) { return g.operation(Op::negate, g.operation(Op::subtract, x, y)); }),
            "y_0 - x_0");
}

TEST(Graph, compares_each_magnitude_once) {
  const auto farthest = [](Graph& g, std::initializer_list<Id> all) {
    Id most = g.constant(0.0);
    for (Id id : all) most = g.operation(Op::farther, most, id);
    return most;
  };
  EXPECT_EQ(emitted([=](Graph& g, Id x, Id y, Id) {
              return farthest(g, {x, y, g.operation(Op::negate, x), y, x});
            }),
            "farther(farther(n(0), x_0), y_0)");
}

TEST(Graph, fuses_a_product_with_a_sum) {
  const auto with = [](bool product_minus, bool sum_minus) {
    return emitted([=](Graph& g, Id x, Id y, Id z) {
      return g.added_up({{z, -1, sum_minus}, g.apart(g.operation(Op::multiply, x, y), product_minus)});
    });
  };
  EXPECT_EQ(with(false, false), "fma(x_0, y_0, z_0)");
  EXPECT_EQ(with(false, true), "-fnma(x_0, y_0, z_0)");
  EXPECT_EQ(with(true, false), "fnma(x_0, y_0, z_0)");
  EXPECT_EQ(with(true, true), "-fma(x_0, y_0, z_0)");
}

TEST(EmitCpp, puts_parentheses_around_divisors_and_sums) {
  EXPECT_EQ(
      emitted([](Graph& g, Id x, Id y, Id z) { return g.operation(Op::divide, x, g.operation(Op::multiply, y, z)); }),
      "x_0 / (y_0 * z_0)");
  EXPECT_EQ(
      emitted([](Graph& g, Id x, Id y, Id z) { return g.operation(Op::multiply, x, g.operation(Op::add, y, z)); }),
      "x_0 * (y_0 + z_0)");
}

TEST(Graph, reuses_what_was_computed_before) {
  Graph graph;
  const Id x = graph.input({"x"}, false), y = graph.input({"y"}, false);
  EXPECT_EQ(graph.operation(Op::multiply, x, y), graph.operation(Op::multiply, y, x));
  EXPECT_NE(graph.operation(Op::subtract, x, y), graph.operation(Op::subtract, y, x));
}

TEST(Graph, refuses_a_number_from_inside_a_loop_that_has_ended) {
  Graph graph;
  const Id x = graph.input({"x"}, false);
  const Id variable = graph.begin_loop(4, {x})[0];
  const Id inside = graph.operation(Op::add, variable, x);
  const Id after = graph.end_loop({inside})[0];
  EXPECT_NO_THROW(graph.operation(Op::add, after, x));
  EXPECT_THROW(graph.operation(Op::add, inside, graph.input({"y"}, false)), std::logic_error);
}

// A loop needs its variables, and a guarded effect needs the numbers that it changes, in the same part.
TEST(Split, keeps_declarations_and_assignments_in_one_part) {
  Graph graph;
  Id value = graph.input({"x.state.q[0]"}, false);
  graph.name(value, "q_0");
  for (int i = 0; i < 10; ++i) {
    const std::vector<Id> begun = graph.begin_loop(3, {value});
    Id inside = begun[0];
    for (int k = 0; k < 5; ++k) inside = graph.operation(Op::fma, inside, inside, graph.constant(k + 2.0));
    value = graph.end_loop({inside})[0];
  }
  const Id condition = graph.operation(Op::less, value, graph.constant(1.0));
  const std::vector<Id> after = graph.effect_if(condition, {}, "hold();", Call::hold, {{{"x.next.q[0]"}, value}});
  graph.effect({{{"x.state.q[0]"}, after[0]}}, "");
  const codegen::Emitted emitted = codegen::emit_cpp(graph);
  const std::regex declared(R"(^ +T (\w+) = )"), changed(R"(^ +(\w+) = )");
  for (int most : {1, 7, 13}) {
    for (const std::string& part : codegen::split(emitted.blocks, most).code) {
      std::set<std::string> own;
      std::istringstream lines(part);
      for (std::string line; std::getline(lines, line);) {
        std::smatch found;
        if (std::regex_search(line, found, declared)) own.insert(found[1]);
        if (std::regex_search(line, found, changed)) {
          EXPECT_TRUE(own.contains(found[1])) << part;
        }
      }
    }
  }
}

// A part defines what it uses, or reads it from where an earlier part stored it.
TEST(Split, hands_on_what_later_parts_use) {
  std::vector<codegen::Block> blocks;
  std::mt19937 random(7);
  for (int i = 0; i < 200; ++i) {
    const int a = i == 0 ? 0 : static_cast<int>(random() % static_cast<unsigned>(i));
    codegen::Block block;
    block.code = fmt::format("    const T a_{} = a_{} + x.a_{};\n", i, a, i + 1);  // a member is not one of the a_
    if (i == 0) block.code = "    const T a_0 = x.state.q[0];\n";
    block.defines = {{fmt::format("a_{}", i), i % 5 == 0}};
    block.operations = 1;
    blocks.push_back(block);
  }
  const codegen::Parts parts = codegen::split(blocks, 16);
  EXPECT_EQ(parts.code.size(), 13u);
  EXPECT_LT(parts.kept + parts.masks, 200) << "places are not reused";
  std::map<std::string, std::string> places;  // the number in each place
  const std::regex read(R"(const auto (\w+) = ((?:kept|masks)\[\d+\]);)"), write(R"(((?:kept|masks)\[\d+\]) = (\w+);)");
  const std::regex define(R"(const T (\w+) = (a_\d+) \+.*)");
  for (const std::string& code : parts.code) {
    std::set<std::string> known = {"a_0"};
    std::istringstream lines(code);
    for (std::string line; std::getline(lines, line);) {
      std::smatch part;
      if (std::regex_search(line, part, read)) {
        EXPECT_EQ(places[part[2]], part[1]);
        known.insert(part[1]);
      } else if (std::regex_search(line, part, write)) {
        EXPECT_TRUE(known.contains(part[2])) << line;
        places[part[1]] = part[2];
      } else if (std::regex_search(line, part, define)) {
        EXPECT_TRUE(known.contains(part[2])) << line;
        known.insert(part[1]);
      }
    }
  }
}

}  // namespace
}  // namespace lockstep::trace
