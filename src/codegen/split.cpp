// Splits blocks into parts, and carries values between them. SPDX-License-Identifier: Apache-2.0
#include "split.h"

#include <fmt/format.h>

#include <cctype>
#include <map>
#include <set>

namespace lockstep::codegen {
namespace {

struct Lifetime {
  bool mask;
  int defined, last;  // parts
  int place = -1;
};

// Visits all words that do not follow a dot.
template <class Visit>
void each_word(const std::string& code, Visit visit) {
  const auto in_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  for (std::size_t i = 0; i < code.size();) {
    if (!in_word(code[i])) {
      ++i;
      continue;
    }
    const std::size_t first = i;
    while (i < code.size() && in_word(code[i])) ++i;
    if (first == 0 || code[first - 1] != '.') visit(code.substr(first, i - first));
  }
}

// Hands out the lowest free place of an array.
class Places {
 public:
  int take() {
    if (free_.empty()) return count_++;
    const int place = *free_.begin();
    free_.erase(free_.begin());
    return place;
  }
  void give_back(int place) { free_.insert(place); }
  int count() const { return count_; }

 private:
  std::set<int> free_;
  int count_ = 0;
};

}  // namespace

Parts split(const std::vector<Block>& blocks, int most) {
  std::vector<int> part_of;
  int parts = 0, operations = 0;
  for (const Block& block : blocks) {
    if (operations > 0 && operations + block.operations > most) ++parts, operations = 0;
    operations += block.operations;
    part_of.push_back(parts);
  }
  ++parts;

  std::map<std::string, Lifetime> lifetimes;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (const Definition& d : blocks[b].defines) lifetimes[d.name] = {d.mask, part_of[b], part_of[b]};
    each_word(blocks[b].code, [&](const std::string& word) {
      if (const auto lifetime = lifetimes.find(word); lifetime != lifetimes.end()) lifetime->second.last = part_of[b];
    });
  }

  Parts result;
  Places numbers, masks;
  const auto places_of = [&](const Lifetime& lifetime) -> Places& { return lifetime.mask ? masks : numbers; };
  for (int part = 0; part < parts; ++part) {
    std::set<std::string> used;
    std::string body, reads, writes;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (part_of[b] != part) continue;
      body += blocks[b].code;
      each_word(blocks[b].code, [&](const std::string& word) {
        if (const auto lifetime = lifetimes.find(word); lifetime != lifetimes.end() && lifetime->second.defined < part)
          used.insert(word);
      });
    }
    for (const std::string& name : used) {
      const Lifetime& lifetime = lifetimes.at(name);
      reads += fmt::format("    const auto {} = {}[{}];\n", name, lifetime.mask ? "masks" : "kept", lifetime.place);
    }
    for (auto& [name, lifetime] : lifetimes) {
      if (lifetime.defined < part && lifetime.last == part) places_of(lifetime).give_back(lifetime.place);
      if (lifetime.defined != part || lifetime.last == part) continue;
      lifetime.place = places_of(lifetime).take();
      writes += fmt::format("    {}[{}] = {};\n", lifetime.mask ? "masks" : "kept", lifetime.place, name);
    }
    result.code.push_back(reads.append(body).append(writes));
  }
  result.kept = numbers.count();
  result.masks = masks.count();
  return result;
}

}  // namespace lockstep::codegen
