// SPDX-License-Identifier: Apache-2.0
#include "lockstep/checkpoints.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

#include "batch/blob.h"
#include "durable_file.h"
#include "files/regular_file.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

namespace fs = std::filesystem;

constexpr int manifest_format = 1;
constexpr const char* manifest_name = "manifest.json";
constexpr std::size_t most_of_manifest = 64u << 20, most_of_part = std::size_t{1} << 40;

[[noreturn]] void fail(const fs::path& path, const std::string& rule, const std::string& remedy) {
  throw UsageError("checkpoint '" + path.string() + "'", rule, remedy);
}

constexpr const char* remove_it = "remove that checkpoint's folder, and go on from the one before";

std::string read(const fs::path& path, std::size_t most) {
  return files::content_of(path.string(), most,
                           [&](const std::string& rule, const std::string&) { fail(path, rule, remove_it); });
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

std::uint32_t checksum_of(const std::string& content) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const unsigned char*>(content.data()), content.size()));
}

std::string file_of(const IdRange& ids) { return fmt::format("{:010}-{}.save", ids.first, ids.count); }

// The ids of environments, one at least, which count on from the first.
IdRange range_of(std::span<const std::uint32_t> ids) {
  for (std::size_t e = 1; e < ids.size(); ++e)
    if (ids[e] != ids[0] + e)
      throw UsageError(
          "ids of the batch",
          fmt::format("do not count on: environment {} has {}, and environment 0 has {}", e, ids[e], ids[0]),
          "give the batch its BatchOptions::first_id, and leave ids() alone");
  return {ids[0], static_cast<int>(ids.size())};
}

// The ids that a part holds.
std::vector<std::uint32_t> ids_in(const Blob& blob, const fs::path& path) {
  for (const Blob::Section& section : blob.sections) {
    if (section.name != "id" || section.rows != 1 || section.number_bytes != sizeof(std::uint32_t)) continue;
    std::vector<std::uint32_t> ids(blob.head.environments);
    if (ids.empty()) break;
    std::memcpy(ids.data(), section.data, ids.size() * sizeof(std::uint32_t));
    return ids;
  }
  fail(path, "has no ids of environments", remove_it);
}

// The blob in a part that has been read. It has the environments that the part's name says.
Blob blob_of(const IdRange& ids, const std::string& content, const fs::path& path) {
  Blob blob = read_blob(bytes_of(content));
  if (range_of(ids_in(blob, path)) != ids) fail(path, "holds environments of other ids than its name says", remove_it);
  return blob;
}

// Adds a part to the checkpoint, whose other parts it must be like.
void add(Checkpoint& checkpoint, const IdRange& ids, const std::string& content, const fs::path& path) {
  const Blob blob = blob_of(ids, content, path);
  const int scalar_bytes = static_cast<int>(blob.head.scalar_bytes);
  if (checkpoint.parts.empty()) {
    checkpoint.version = blob.version, checkpoint.plan_hash = blob.head.plan_hash;
    checkpoint.scalar_bytes = scalar_bytes;
  }
  const auto same = [&](const char* what, const auto& own, const auto& other) {
    if (own != other)
      fail(path, fmt::format("is of {} {}, and the part '{}' of {}", what, own, checkpoint.parts[0].file, other),
           "run the same program with the same model and settings on all ranks");
  };
  same("plan", fmt::format("{:016x}", blob.head.plan_hash), fmt::format("{:016x}", checkpoint.plan_hash));
  same("numbers of bytes", scalar_bytes, checkpoint.scalar_bytes);
  same("version", escaped(blob.version), escaped(checkpoint.version));
  checkpoint.parts.push_back({ids, file_of(ids), content.size(), checksum_of(content)});
}

// Throws unless the ranges follow each other, from the lowest to the highest id.
void require_whole(std::span<const IdRange> ranges) {
  const auto before = [](const IdRange& a, const IdRange& b) { return a.first < b.first; };
  const auto [lowest, highest] = std::minmax_element(ranges.begin(), ranges.end(), before);
  const std::int64_t first = lowest->first, end = std::int64_t{highest->first} + highest->count;
  require_partition(ranges, end - first, lowest->first);
}

std::string to_json(const Checkpoint& checkpoint) {
  nlohmann::ordered_json json = {{"format", manifest_format},
                                 {"number", checkpoint.number},
                                 {"lockstep", checkpoint.version},
                                 {"plan", fmt::format("{:016x}", checkpoint.plan_hash)},
                                 {"scalar_bytes", checkpoint.scalar_bytes},
                                 {"parts", nlohmann::ordered_json::array()}};
  for (const Checkpoint::Part& part : checkpoint.parts)
    json["parts"].push_back({{"first", part.ids.first},
                             {"count", part.ids.count},
                             {"file", part.file},
                             {"bytes", part.bytes},
                             {"crc32", part.checksum}});
  return json.dump(2) + "\n";
}

Checkpoint from_json(const std::string& text, const fs::path& path) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    if (const int format = json.at("format"); format != manifest_format)
      fail(path, fmt::format("has the format {}, and this library reads {}", format, manifest_format),
           "read it by the version of lockstep that wrote it");
    Checkpoint own;
    own.number = json.at("number"), own.version = json.at("lockstep"), own.scalar_bytes = json.at("scalar_bytes");
    const std::string plan = json.at("plan");
    const auto [behind, error] = std::from_chars(plan.data(), plan.data() + plan.size(), own.plan_hash, 16);
    std::vector<IdRange> ranges;
    for (const nlohmann::json& part : json.at("parts")) {
      const std::int64_t first = part.at("first"), count = part.at("count");
      ranges.push_back({static_cast<std::uint32_t>(first), static_cast<int>(count)});
      if (part.at("file") != file_of(ranges.back()) || first != ranges.back().first || count != ranges.back().count)
        fail(path, "names files that are no parts", remove_it);
      own.parts.push_back({ranges.back(), part.at("file"), part.at("bytes"), part.at("crc32")});
    }
    if (error != std::errc() || behind != plan.data() + plan.size() || ranges.empty())
      fail(path, "has no plan or no parts", remove_it);
    require_whole(ranges);
    return own;
  } catch (const nlohmann::json::exception& error) {
    fail(path, std::string("is no whole manifest: ") + error.what(), remove_it);
  }
}

// Numbers of the folders in it, the highest first.
std::vector<std::uint64_t> numbers_in(const fs::path& folder) {
  std::vector<std::uint64_t> numbers;
  std::error_code failed;
  const fs::directory_iterator entries(folder, failed);
  if (failed) fail(folder, "cannot be read: " + failed.message(), "check the folder and its permissions");
  for (const fs::directory_entry& entry : entries) {
    const std::string name = entry.path().filename().string();
    std::uint64_t number = 0;
    const auto [behind, error] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (error == std::errc() && behind == name.data() + name.size() && entry.is_directory(failed))
      numbers.push_back(number);
  }
  std::sort(numbers.begin(), numbers.end(), std::greater());
  return numbers;
}

}  // namespace

Checkpoints::Checkpoints(fs::path folder, int keep) : folder_(std::move(folder)), keep_(keep) {
  if (keep < 0) fail(folder_, fmt::format("keeps {} complete ones", keep), "give 0 to keep all, or how many");
  std::error_code error, ignored;
  fs::create_directories(folder_, error);
  if (!fs::is_directory(folder_, ignored))
    fail(folder_, "is no folder: " + error.message(), "give a folder that can be made");
}

fs::path Checkpoints::folder_of(std::uint64_t number) const { return folder_ / fmt::format("{:012}", number); }

template <class S>
void Checkpoints::write(std::uint64_t number, const Batch<S>& batch) const {
  const fs::path folder = folder_of(number);
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) fail(folder, "cannot be made: " + error.message(), "check the folder and its permissions");
  if (is_complete(number))
    fail(folder, "is complete already", "give another number, or remove its folder before any rank writes");
  ranks::sync_folder(folder_);
  ranks::write_durably(folder / file_of(range_of(batch.ids())), batch.save());
}

Checkpoint Checkpoints::complete(std::uint64_t number, std::span<const IdRange> ranges) const {
  if (ranges.empty()) throw UsageError("ids of ranks", "are none", "give the range of each rank");
  require_whole(ranges);
  std::vector<IdRange> sorted(ranges.begin(), ranges.end());
  std::sort(sorted.begin(), sorted.end(), [](const IdRange& a, const IdRange& b) { return a.first < b.first; });
  Checkpoint own;
  own.number = number;
  const fs::path folder = folder_of(number);
  for (const IdRange& ids : sorted) {
    const fs::path path = folder / file_of(ids);
    add(own, ids, read(path, most_of_part), path);
  }
  const std::string manifest = to_json(own);
  ranks::write_durably(folder / manifest_name, bytes_of(manifest));
  int complete = 0;
  for (const std::uint64_t other : numbers_in(folder_)) {
    if (other > number || keep_ == 0) continue;
    if (complete < keep_) {
      complete += is_complete(other) ? 1 : 0;
      continue;
    }
    std::error_code ignored;  // what cannot be removed stays; without a manifest it counts for nothing
    fs::remove(folder_of(other) / manifest_name, ignored);
    fs::remove_all(folder_of(other), ignored);
  }
  return own;
}

bool Checkpoints::is_complete(std::uint64_t number) const {
  std::error_code ignored;
  return fs::exists(folder_of(number) / manifest_name, ignored);
}

Checkpoint Checkpoints::open(std::uint64_t number) const {
  const fs::path path = folder_of(number) / manifest_name;
  Checkpoint own = from_json(read(path, most_of_manifest), path);
  if (own.number != number) fail(path, fmt::format("is that of checkpoint {}", own.number), remove_it);
  return own;
}

std::optional<Checkpoint> Checkpoints::latest() const {
  for (const std::uint64_t number : numbers_in(folder_))
    if (is_complete(number)) return open(number);
  return std::nullopt;
}

template <class S>
void Checkpoints::restore(const Checkpoint& checkpoint, Batch<S>& batch) const {
  const fs::path folder = folder_of(checkpoint.number);
  if (checkpoint.scalar_bytes != sizeof(S))
    fail(folder, fmt::format("has numbers of {} bytes, and the batch of {}", checkpoint.scalar_bytes, sizeof(S)),
         checkpoint.scalar_bytes == 4 ? "use Batch<float>" : "use Batch<double>");
  if (checkpoint.plan_hash != batch.plan().hash())
    fail(folder,
         fmt::format("is of plan {:016x}, and the batch has plan {:016x}", checkpoint.plan_hash, batch.plan().hash()),
         "go on with the model, the settings and the version of lockstep that wrote it");

  // What each part has of the batch. All is read before anything is written.
  struct Taken {
    std::string content;
    std::vector<int> into, from;
  };
  std::vector<Taken> taken;
  const std::span<const std::uint32_t> ids = std::as_const(batch).ids();
  std::size_t found = 0;
  for (const Checkpoint::Part& part : checkpoint.parts) {
    Taken own;
    for (std::size_t e = 0; e < ids.size(); ++e) {
      const std::int64_t place = std::int64_t{ids[e]} - part.ids.first;
      if (place < 0 || place >= part.ids.count) continue;
      own.into.push_back(static_cast<int>(e)), own.from.push_back(static_cast<int>(place));
    }
    if (own.into.empty()) continue;
    found += own.into.size();
    const fs::path path = folder / part.file;
    own.content = read(path, most_of_part);
    if (own.content.size() != part.bytes || checksum_of(own.content) != part.checksum)
      fail(path, "is not as its manifest says", remove_it);
    const Blob blob = blob_of(part.ids, own.content, path);
    if (blob.head.plan_hash != checkpoint.plan_hash || blob.head.scalar_bytes != sizeof(S))
      fail(path, "is of another plan or precision than its manifest says", remove_it);
    taken.push_back(std::move(own));
  }
  if (found != ids.size())
    fail(folder, fmt::format("has {} of the {} environments of the batch, from id {} on", found, ids.size(), ids[0]),
         "give the ranks the ids that the checkpoint has");
  for (const Taken& own : taken) batch.restore(bytes_of(own.content), own.into, own.from);
}

template void Checkpoints::write(std::uint64_t, const Batch<float>&) const;
template void Checkpoints::write(std::uint64_t, const Batch<double>&) const;
template void Checkpoints::restore(const Checkpoint&, Batch<float>&) const;
template void Checkpoints::restore(const Checkpoint&, Batch<double>&) const;

}  // namespace lockstep
