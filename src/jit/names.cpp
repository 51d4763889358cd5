// SPDX-License-Identifier: Apache-2.0
#include "names.h"

#include <elf.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string_view>

// What gdb looks for in a process ("JIT Compilation Interface" in its manual). Other libraries may have the same.
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
[[gnu::weak, gnu::used, gnu::visibility("default")]] jit_descriptor __jit_debug_descriptor = {1, 0, nullptr, nullptr};
[[gnu::weak, gnu::used, gnu::noinline, gnu::visibility("default")]] void __jit_debug_register_code() {
  asm volatile("" ::: "memory");  // gdb stops here and reads the descriptor
}
}

namespace lockstep::jit {
namespace {

enum Section { none, text, symbols, names, sections };

// Where a section of text begins in the file, and what it holds.
Elf64_Shdr section(int name, std::uint32_t type, const std::string& bytes, std::size_t at) {
  Elf64_Shdr header{};
  header.sh_name = static_cast<std::uint32_t>(name);
  header.sh_type = type;
  header.sh_offset = at;
  header.sh_size = bytes.size();
  header.sh_addralign = 1;
  return header;
}

template <class Header>
std::string bytes_of(const Header& header) {
  return {reinterpret_cast<const char*>(&header), sizeof(header)};
}

// An ELF file that has nothing but the names of code that stands in memory already.
std::string symbol_file(const std::vector<NamedCode>& code) {
  std::uintptr_t first = UINTPTR_MAX, last = 0;
  std::string table = bytes_of(Elf64_Sym{}), text_of_names(1, '\0');
  for (const NamedCode& named : code) {
    const auto start = reinterpret_cast<std::uintptr_t>(named.start);
    const auto bytes = static_cast<std::uintptr_t>(named.bytes);
    first = std::min(first, start), last = std::max(last, start + bytes);
    Elf64_Sym symbol{};
    symbol.st_name = static_cast<std::uint32_t>(text_of_names.size());
    symbol.st_info = ELF64_ST_INFO(STB_GLOBAL, STT_FUNC);
    symbol.st_shndx = text;
    symbol.st_value = start;
    symbol.st_size = bytes;
    table += bytes_of(symbol);
    text_of_names += named.name + '\0';
  }
  const std::string section_names("\0.text\0.symtab\0.strtab\0.shstrtab\0", 33);

  Elf64_Shdr headers[sections + 1] = {};
  std::size_t at = sizeof(Elf64_Ehdr) + sizeof(headers);
  headers[text] = section(1, SHT_NOBITS, "", at);
  headers[text].sh_flags = SHF_ALLOC | SHF_EXECINSTR;
  headers[text].sh_addr = first;
  headers[text].sh_size = last - first;
  headers[symbols] = section(7, SHT_SYMTAB, table, at);
  headers[symbols].sh_link = names;
  headers[symbols].sh_info = 1;  // where global symbols begin
  headers[symbols].sh_entsize = sizeof(Elf64_Sym);
  headers[names] = section(15, SHT_STRTAB, text_of_names, at += table.size());
  headers[sections] = section(23, SHT_STRTAB, section_names, at += text_of_names.size());

  Elf64_Ehdr file{};
  std::memcpy(file.e_ident, ELFMAG, SELFMAG);
  file.e_ident[EI_CLASS] = ELFCLASS64;
  file.e_ident[EI_DATA] = ELFDATA2LSB;
  file.e_ident[EI_VERSION] = EV_CURRENT;
  file.e_type = ET_EXEC;  // addresses are final
  file.e_machine = EM_X86_64;
  file.e_version = EV_CURRENT;
  file.e_shoff = sizeof(file);
  file.e_ehsize = sizeof(file);
  file.e_shentsize = sizeof(Elf64_Shdr);
  file.e_shnum = sections + 1;
  file.e_shstrndx = sections;
  return bytes_of(file) + bytes_of(headers) + table + text_of_names + section_names;
}

// An entry of gdb's list, from its construction to its end.
class KnownToDebugger {
 public:
  explicit KnownToDebugger(const std::vector<NamedCode>& code) : file_(symbol_file(code)) {
    entry_.symfile_addr = file_.data();
    entry_.symfile_size = file_.size();
    const std::lock_guard lock(mutex());
    entry_.next_entry = __jit_debug_descriptor.first_entry;
    if (entry_.next_entry) entry_.next_entry->prev_entry = &entry_;
    __jit_debug_descriptor.first_entry = &entry_;
    tell(registered);
  }
  ~KnownToDebugger() {
    const std::lock_guard lock(mutex());
    (entry_.prev_entry ? entry_.prev_entry->next_entry : __jit_debug_descriptor.first_entry) = entry_.next_entry;
    if (entry_.next_entry) entry_.next_entry->prev_entry = entry_.prev_entry;
    tell(unregistered);
  }
  KnownToDebugger(const KnownToDebugger&) = delete;
  KnownToDebugger& operator=(const KnownToDebugger&) = delete;

 private:
  enum Action : std::uint32_t { registered = 1, unregistered = 2 };

  static std::mutex& mutex() {
    static std::mutex of_the_list;
    return of_the_list;
  }
  void tell(Action action) {
    __jit_debug_descriptor.action_flag = action;
    __jit_debug_descriptor.relevant_entry = &entry_;
    __jit_debug_register_code();
  }

  std::string file_;
  jit_code_entry entry_{};
};

}  // namespace

std::shared_ptr<const void> name_code(const std::vector<NamedCode>& code) {
  if (const char* const folder = std::getenv("LOCKSTEP_PERF")) {
    std::string lines;
    for (const NamedCode& named : code)
      lines += fmt::format("{:x} {:x} {}\n", reinterpret_cast<std::uintptr_t>(named.start), named.bytes, named.name);
    const std::string path = fmt::format("{}/perf-{}.map", folder, getpid());
    if (const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0600); file >= 0) {
      (void)!write(file, lines.data(), lines.size());
      close(file);
    }
  }
  const char* const gdb = std::getenv("LOCKSTEP_GDB");
  if (!gdb || std::string_view(gdb) != "1" || code.empty()) return nullptr;
  return std::make_shared<const KnownToDebugger>(code);
}

}  // namespace lockstep::jit
