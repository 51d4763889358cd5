// What debuggers and profilers are told of machine code. SPDX-License-Identifier: Apache-2.0
#include "jit/names.h"

#include <elf.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

// gdb reads these names and this layout.
extern "C" {
struct jit_code_entry {
  jit_code_entry *next_entry, *prev_entry;
  const char* symfile_addr;
  std::uint64_t symfile_size;
};
struct jit_descriptor {
  std::uint32_t version, action_flag;
  jit_code_entry *relevant_entry, *first_entry;
};
extern jit_descriptor __jit_debug_descriptor;
}

namespace lockstep::jit {
namespace {

const char code[64] = {};

class Names : public testing::Test {
 protected:
  void TearDown() override {
    unsetenv("LOCKSTEP_GDB");
    unsetenv("LOCKSTEP_PERF");
  }
};

template <class Entry>
Entry entry_at(const char* file, std::size_t at) {
  Entry entry;
  std::memcpy(&entry, file + at, sizeof(entry));
  return entry;
}

// The names in an ELF file in memory, with their places, by another way than they are written: by section types.
std::map<std::string, std::pair<std::uintptr_t, std::size_t>> symbols_in(const jit_code_entry& of) {
  const auto header = entry_at<Elf64_Ehdr>(of.symfile_addr, 0);
  EXPECT_EQ(std::memcmp(header.e_ident, ELFMAG, SELFMAG), 0);
  std::map<std::string, std::pair<std::uintptr_t, std::size_t>> found;
  for (std::size_t i = 0; i < header.e_shnum; ++i) {
    const auto section = entry_at<Elf64_Shdr>(of.symfile_addr, header.e_shoff + i * header.e_shentsize);
    if (section.sh_type != SHT_SYMTAB) continue;
    const auto names = entry_at<Elf64_Shdr>(of.symfile_addr, header.e_shoff + section.sh_link * header.e_shentsize);
    EXPECT_LE(names.sh_offset + names.sh_size, of.symfile_size);
    for (std::size_t k = 1; k < section.sh_size / section.sh_entsize; ++k) {
      const auto symbol = entry_at<Elf64_Sym>(of.symfile_addr, section.sh_offset + k * section.sh_entsize);
      found[of.symfile_addr + names.sh_offset + symbol.st_name] = {symbol.st_value, symbol.st_size};
    }
  }
  return found;
}

TEST_F(Names, are_told_to_nobody_who_does_not_ask) {
  EXPECT_EQ(name_code({{"a step", code, 32}}), nullptr);
  EXPECT_EQ(__jit_debug_descriptor.first_entry, nullptr);
}

TEST_F(Names, are_on_gdbs_list_as_long_as_the_code_lives) {
  setenv("LOCKSTEP_GDB", "1", 1);
  const auto start = reinterpret_cast<std::uintptr_t>(code);
  auto first = name_code({{"a step", code, 24}, {"its end", code + 24, 8}});
  auto second = name_code({{"another", code + 32, 16}});
  auto third = name_code({{"a third", code + 48, 16}});
  EXPECT_EQ(__jit_debug_descriptor.action_flag, 1u);
  second.reset();
  EXPECT_EQ(__jit_debug_descriptor.action_flag, 2u);
  const jit_code_entry* entry = __jit_debug_descriptor.first_entry;
  ASSERT_NE(entry, nullptr);
  EXPECT_EQ(symbols_in(*entry).at("a third"), std::make_pair(start + 48, std::size_t{16}));
  ASSERT_NE(entry->next_entry, nullptr);
  EXPECT_EQ(entry->next_entry->prev_entry, entry);
  const auto symbols = symbols_in(*entry->next_entry);
  EXPECT_EQ(symbols.at("a step"), std::make_pair(start, std::size_t{24}));
  EXPECT_EQ(symbols.at("its end"), std::make_pair(start + 24, std::size_t{8}));
  EXPECT_EQ(entry->next_entry->next_entry, nullptr);
  third.reset(), first.reset();
  EXPECT_EQ(__jit_debug_descriptor.first_entry, nullptr);
}

TEST_F(Names, are_in_the_file_that_perf_looks_for) {
  const std::filesystem::path folder = testing::TempDir() + "/lockstep-names";
  std::filesystem::create_directories(folder);
  setenv("LOCKSTEP_PERF", folder.c_str(), 1);
  name_code({{"a step of \"mine\"", code, 20}});
  const auto file = folder / ("perf-" + std::to_string(getpid()) + ".map");
  std::ifstream lines(file);
  std::uintptr_t start = 0;
  std::size_t bytes = 0;
  std::string name;
  lines >> std::hex >> start >> bytes >> std::ws;
  std::getline(lines, name);
  EXPECT_EQ(start, reinterpret_cast<std::uintptr_t>(code));
  EXPECT_EQ(bytes, 20u);
  EXPECT_EQ(name, "a step of \"mine\"");
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace lockstep::jit
