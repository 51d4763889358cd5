#include "split.h"

#include <fmt/format.h>

#include <cctype>
#include <map>
#include <set>

namespace lockstep::codegen {
namespace {

struct Life {
  bool mask;
  int defined, last;  // parts
  int slot = -1;
};

// Words that are no members of others.
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

// Places that are handed out, returned and handed out again.
class Slots {
 public:
  int take() {
    if (free_.empty()) return count_++;
    const int slot = *free_.begin();
    free_.erase(free_.begin());
    return slot;
  }
  void give_back(int slot) { free_.insert(slot); }
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

  std::map<std::string, Life> lives;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (const Definition& d : blocks[b].defines) lives[d.name] = {d.mask, part_of[b], part_of[b]};
    each_word(blocks[b].code, [&](const std::string& word) {
      if (const auto life = lives.find(word); life != lives.end()) life->second.last = part_of[b];
    });
  }

  Parts result;
  Slots numbers, masks;
  const auto slots_of = [&](const Life& life) -> Slots& { return life.mask ? masks : numbers; };
  for (int part = 0; part < parts; ++part) {
    std::set<std::string> wanted;
    std::string body, reads, writes;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (part_of[b] != part) continue;
      body += blocks[b].code;
      each_word(blocks[b].code, [&](const std::string& word) {
        if (const auto life = lives.find(word); life != lives.end() && life->second.defined < part) wanted.insert(word);
      });
    }
    for (const std::string& name : wanted) {
      const Life& life = lives.at(name);
      reads += fmt::format("    const auto {} = {}[{}];\n", name, life.mask ? "masks" : "kept", life.slot);
    }
    for (auto& [name, life] : lives) {
      if (life.defined < part && life.last == part) slots_of(life).give_back(life.slot);
      if (life.defined != part || life.last == part) continue;
      life.slot = slots_of(life).take();
      writes += fmt::format("    {}[{}] = {};\n", life.mask ? "masks" : "kept", life.slot, name);
    }
    result.code.push_back(reads + body + writes);
  }
  result.kept = numbers.count();
  result.masks = masks.count();
  return result;
}

}  // namespace lockstep::codegen
