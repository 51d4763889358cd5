// The bytes that Batch::save() makes: their layout and checksums. SPDX-License-Identifier: Apache-2.0
//
//   BlobHead, BlobSection for each section, the settings, CRC-32 of all these, then each section's rows.
//
// Rows are [row][environment], without padding, in the byte order of the machine. Every byte is under a checksum or
// compared, so no byte can be wrong unnoticed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "plan/identity.h"

namespace lockstep {

struct BlobHead {
  std::array<char, 8> magic{'L', 'O', 'C', 'K', 'S', 'T', 'E', 'P'};
  std::uint32_t byte_order = 0x01020304, format = identity_format;
  std::uint64_t bytes = 0;  ///< of the whole blob
  std::uint64_t plan_hash = 0, model_hash = 0;
  std::uint32_t scalar_bytes = 0, environments = 0, sections = 0, settings_bytes = 0;
  std::array<char, 16> version{};  ///< of the library
};

struct BlobSection {
  std::array<char, 24> name{};
  std::uint32_t rows = 0, number_bytes = 0, checksum = 0;
};

/// A blob that has been checked.
struct Blob {
  struct Section {
    std::string name;
    int rows;
    std::size_t number_bytes;
    const std::byte* data;  ///< not aligned
  };
  BlobHead head;
  std::string version, settings;
  std::vector<Section> sections;
};

/// Text of a blob for a message: bytes that are no printable ASCII become \x0a and the like.
std::string escaped(const std::string& text);

std::string section_of_blob(const std::string& name);

inline constexpr const char* whole_blob = "give all bytes that Batch::save() returned, unchanged";

/// fill(section, to) writes the rows of a section.
std::vector<std::byte> write_blob(BlobHead head, const std::string& settings, std::vector<BlobSection> sections,
                                  const std::function<void(std::size_t section, std::byte* to)>& fill);

/// Throws UsageError unless each byte is as it was written.
Blob read_blob(std::span<const std::byte> bytes);

}  // namespace lockstep
