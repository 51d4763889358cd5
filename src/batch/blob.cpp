// Writes and checks blobs. SPDX-License-Identifier: Apache-2.0
#include "blob.h"

#include <fmt/format.h>
#include <zlib.h>

#include <bit>
#include <cstring>
#include <type_traits>

#include "lockstep/error.h"
#include "lockstep/version.h"

namespace lockstep {
namespace {

static_assert(std::has_unique_object_representations_v<BlobHead>, "no padding");
static_assert(std::has_unique_object_representations_v<BlobSection>, "no padding");

using Checksum = std::uint32_t;

Checksum checksum_of(const std::byte* data, std::size_t bytes) {
  return static_cast<Checksum>(crc32_z(0, reinterpret_cast<const unsigned char*>(data), bytes));
}

constexpr std::uint32_t swapped(std::uint32_t x) {
  return x >> 24 | (x >> 8 & 0xff00u) | (x << 8 & 0xff0000u) | x << 24;
}

void require(bool holds, const std::string& element, const std::string& rule, const std::string& remedy) {
  if (!holds) throw UsageError(element, rule, remedy);
}

// Reads one structure after the other.
class Reader {
 public:
  explicit Reader(const std::byte* at) : at_(at) {}
  template <class T>
  T next() {
    T value;
    std::memcpy(&value, at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  const std::byte* skip(std::size_t bytes) { return (at_ += bytes) - bytes; }

 private:
  const std::byte* at_;
};

class Writer {
 public:
  explicit Writer(std::byte* at) : at_(at) {}
  void put(const void* data, std::size_t bytes) {
    if (bytes > 0) std::memcpy(at_, data, bytes);
    at_ += bytes;
  }
  template <class T>
  void put(const T& value) {
    put(&value, sizeof value);
  }

 private:
  std::byte* at_;
};

std::uint64_t head_bytes(const BlobHead& head) {
  return sizeof(BlobHead) + std::uint64_t{head.sections} * sizeof(BlobSection) + head.settings_bytes;
}

std::uint64_t bytes_of(const BlobSection& section, std::uint32_t environments) {
  return std::uint64_t{section.rows} * section.number_bytes * environments;
}

template <std::size_t most>
std::string text_of(const std::array<char, most>& text) {
  return std::string(text.data(), strnlen(text.data(), most));
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string words;
  for (const char c : text)
    words += c >= ' ' && c <= '~' ? std::string(1, c) : fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
  return words;
}

std::string section_of_blob(const std::string& name) { return "section '" + escaped(name) + "' of the blob"; }

std::vector<std::byte> write_blob(BlobHead head, const std::string& settings, std::vector<BlobSection> sections,
                                  const std::function<void(std::size_t, std::byte*)>& fill) {
  head.sections = static_cast<std::uint32_t>(sections.size());
  head.settings_bytes = static_cast<std::uint32_t>(settings.size());
  head.bytes = head_bytes(head) + sizeof(Checksum);
  const std::uint64_t first = head.bytes;
  for (const BlobSection& section : sections) head.bytes += bytes_of(section, head.environments);
  std::vector<std::byte> blob(head.bytes);
  std::byte* data = blob.data() + first;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const std::uint64_t bytes = bytes_of(sections[i], head.environments);
    fill(i, data);
    sections[i].checksum = checksum_of(data, bytes);
    data += bytes;
  }
  Writer to(blob.data());
  to.put(head);
  to.put(sections.data(), sections.size() * sizeof(BlobSection));
  to.put(settings.data(), settings.size());
  to.put(checksum_of(blob.data(), head_bytes(head)));
  return blob;
}

Blob read_blob(std::span<const std::byte> bytes) {
  const std::uint64_t size = bytes.size();
  const std::string has = "has " + std::to_string(size) + " bytes, ";
  require(size >= sizeof(BlobHead), "blob", has + "fewer than its head of " + std::to_string(sizeof(BlobHead)),
          whole_blob);

  // What it is, of which machine, and of which format.
  Reader from(bytes.data());
  Blob blob{from.next<BlobHead>(), {}, {}, {}};
  const BlobHead& head = blob.head;
  require(head.magic == BlobHead().magic, "blob", "does not begin with LOCKSTEP", whole_blob);
  require(head.byte_order != swapped(BlobHead().byte_order), "blob", "was saved on a machine with the other byte order",
          "restore it on one like that");
  require(head.byte_order == BlobHead().byte_order, "blob", "has a damaged mark of its byte order", whole_blob);
  require(head.format == BlobHead().format, "blob",
          "has format " + std::to_string(head.format) + " of lockstep " + escaped(text_of(head.version)) +
              ", and lockstep " + version() + " reads format " + std::to_string(identity_format),
          "restore it by the version of the library that saved it");

  // Lengths, before anything is read by them.
  require(size == head.bytes, "blob",
          has + "and its head says " + std::to_string(head.bytes) +
              (size < head.bytes ? ": the end is missing" : ": something was added"),
          whole_blob);
  require(head_bytes(head) + sizeof(Checksum) <= size, "blob", "has a damaged head: its parts are too long",
          whole_blob);
  require(head.environments <= size, "blob", "has a damaged head: it has no room for its environments", whole_blob);

  // The rest of the head, and its checksum.
  std::vector<BlobSection> sections;
  for (std::uint32_t i = 0; i < head.sections; ++i) sections.push_back(from.next<BlobSection>());
  blob.settings.assign(reinterpret_cast<const char*>(from.skip(head.settings_bytes)), head.settings_bytes);
  require(from.next<Checksum>() == checksum_of(bytes.data(), head_bytes(head)), "blob",
          "has a damaged head: its checksum does not fit", whole_blob);

  // Sections, each with a checksum of its own.
  blob.version = text_of(head.version);
  std::uint64_t left = size - head_bytes(head) - sizeof(Checksum);
  for (const BlobSection& section : sections) {
    const std::string name = text_of(section.name), element = section_of_blob(name);
    const std::uint64_t numbers = std::uint64_t{section.rows} * head.environments;
    require((section.number_bytes == 4 || section.number_bytes == 8) && numbers <= left / section.number_bytes, element,
            "does not fit into the blob", whole_blob);
    const std::uint64_t length = numbers * section.number_bytes;
    const std::byte* const data = from.skip(length);
    require(section.checksum == checksum_of(data, length), element, "is damaged: its checksum does not fit",
            whole_blob);
    blob.sections.push_back({name, static_cast<int>(section.rows), section.number_bytes, data});
    left -= length;
  }
  require(left == 0, "blob", "holds bytes of no section", whole_blob);
  return blob;
}

}  // namespace lockstep
