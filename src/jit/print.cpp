// SPDX-License-Identifier: Apache-2.0
#include "print.h"

#include <fmt/format.h>

namespace lockstep::jit {
namespace {

std::string words(const Memory& at) {
  constexpr const char* bases[] = {"?", "block", "slots", "tile", "constants", "handed"};
  return fmt::format("[{} + {}]", bases[at.base], at.offset);
}
std::string r(int number) { return fmt::format("r{}", number); }

std::string formula(const Instruction& i) {
  const std::string a = r(i.a), b = i.in_memory ? words(i.at) : r(i.b);
  switch (i.op) {
    case Op::sqrt: return fmt::format("sqrt({})", i.in_memory ? words(i.at) : a);
    case Op::shift_left: return fmt::format("{} << {}", a, i.number);
    case Op::spread_sign: return fmt::format("sign bits of {}", a);
    case Op::add: return a + " + " + b;
    case Op::subtract: return a + " - " + b;
    case Op::multiply: return a + " * " + b;
    case Op::divide: return a + " / " + b;
    case Op::less: return a + " < " + b;
    case Op::greater: return a + " > " + b + " as integers";
    case Op::larger: return "the larger of " + a + " and " + b + " as integers";
    case Op::both: return a + " & " + b;
    case Op::either: return a + " | " + b;
    case Op::differ: return a + " ^ " + b;
    case Op::select: return fmt::format("{} ? {} : {}", r(i.c), b, a);
    default: return "?";
  }
}

// Which operand is the product's factor and which the summand depends on the form.
std::string multiply_add(const Instruction& i) {
  const std::string own = r(i.to), second = r(i.a), third = i.in_memory ? words(i.at) : r(i.b);
  const std::string product = i.number == 132   ? own + " * " + third
                              : i.number == 213 ? second + " * " + own
                                                : second + " * " + third;
  const std::string added = i.number == 132 ? second : i.number == 213 ? third : own;
  if (i.op == Op::fnma) return added + " - " + product;
  return product + (i.op == Op::fma ? " + " : " - ") + added;
}

std::string line(const Instruction& i) {
  switch (i.kind) {
    case Instruction::load: return r(i.to) + " = " + words(i.at);
    case Instruction::store: return words(i.at) + " = " + r(i.a);
    case Instruction::move: return r(i.to) + " = " + r(i.a);
    case Instruction::compute: return r(i.to) + " = " + formula(i);
    case Instruction::fused: return r(i.to) + " = " + multiply_add(i);
    case Instruction::ternary:
      return fmt::format("{0} = bits {1:#x} of {0}, {2}, {3}", r(i.to), i.number, r(i.a),
                         i.in_memory ? words(i.at) : r(i.b));
    case Instruction::begin_part: return "part, for each tile {";
    case Instruction::end_part: return "}";
    case Instruction::begin_loop: return fmt::format("{} times {{", i.number);
    case Instruction::begin_unless: return "if no lane of " + r(i.a) + " {";
    case Instruction::begin_scope:
      return i.number > 1 ? fmt::format("while a lane of {}, {} times at most {{", r(i.a), i.number)
                          : fmt::format("if a lane of {} {{", r(i.a));
    case Instruction::end_loop:
    case Instruction::end_scope: return i.a < 0 ? "}" : "} while a lane of " + r(i.a);
    case Instruction::if_any: return fmt::format("if a lane of {}: rare part {}", r(i.a), i.number);
    case Instruction::call: return fmt::format("call stage {}", i.number);
    case Instruction::resume: return "back";
    case Instruction::run: return fmt::format("run subroutine {}", i.number);
  }
  return "";
}

void append(const std::vector<Instruction>& instructions, const Listing& listing, std::string& text) {
  for (const Instruction& i : instructions) {
    const std::string name = i.value < 0 ? "" : listing.names[static_cast<std::size_t>(i.value)];
    text += name.empty() ? line(i) + "\n" : fmt::format("{:<48} {}\n", line(i), name);
  }
}

}  // namespace

std::string print(const Allocated& code, const Listing& listing) {
  std::string text;
  append(code.instructions, listing, text);
  for (std::size_t i = 0; i < code.cold.size(); ++i) {
    text += fmt::format("rare part {}:\n", i);
    append(code.cold[i], listing, text);
  }
  for (std::size_t i = 0; i < code.subroutines.size(); ++i) {
    text += fmt::format("subroutine {}:\n", i);
    append(code.subroutines[i], listing, text);
  }
  return text;
}

}  // namespace lockstep::jit
