// SPDX-License-Identifier: Apache-2.0
#include "rank.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <string_view>

#include "options.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

RankOption rank_of(const std::string& text) {
  if (text == "auto") return {rank_of_launcher(), true};
  RankOption rank;
  const std::size_t slash = std::min(text.find('/'), text.size());
  const auto number = [&](std::size_t begin, std::size_t end, int& to) {
    const auto [behind, error] = std::from_chars(text.data() + begin, text.data() + end, to);
    return error == std::errc() && behind == text.data() + end;
  };
  if (slash == text.size() || !number(0, slash, rank.rank) || !number(slash + 1, text.size(), rank.ranks) ||
      rank.rank < 0 || rank.rank >= rank.ranks)
    throw InputError(fmt::format("--rank: '{}' is no rank; give 0/4 for the first of four, or auto", text));
  return rank;
}

}  // namespace

void add_rank(CLI::App& app, RankOption& rank, const std::string& help) {
  add_parsed(app, "--rank", rank, rank_of, help + "; auto: what mpirun, torchrun or srun say")->type_name("R/N");
}

std::string name_of_rank(const std::string& option, std::string name, const RankOption& rank) {
  constexpr std::string_view own = "{rank}";
  const std::size_t place = name.find(own);
  if (place != std::string::npos) return name.replace(place, own.size(), std::to_string(rank.rank));
  if (rank.by_launcher && rank.ranks > 1 && !name.empty())
    throw InputError(
        fmt::format("{}: {} ranks would all write '{}'; put {} into the name", option, rank.ranks, name, own));
  return name;
}

}  // namespace lockstep::tool
