// Checkpoints that several processes write together. SPDX-License-Identifier: Apache-2.0
//
// Each rank writes the environments that it owns; then one of them says that the checkpoint is complete. Any number of
// ranks goes on from it, with the same bits:
//
//     Checkpoints checkpoints("run7");                       // a folder that all ranks see
//     if (const auto last = checkpoints.latest()) checkpoints.restore(*last, batch);
//     ...
//     checkpoints.write(update, batch);                      // each rank
//     // wait for all ranks
//     if (rank == 0) checkpoints.complete(update, ranges);   // what a killed rank leaves half done is never read
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "lockstep/ranks.h"

namespace lockstep {

/// A checkpoint that is complete, as its manifest says.
struct Checkpoint {
  struct Part {
    IdRange ids;
    std::string file;  ///< in the folder of the checkpoint
    std::uint64_t bytes = 0;
    std::uint32_t checksum = 0;  ///< CRC-32
  };
  std::uint64_t number = 0;
  std::string version;  ///< of the library that wrote it
  std::uint64_t plan_hash = 0;
  int scalar_bytes = 0;     ///< 4: Batch<float>, 8: Batch<double>
  std::vector<Part> parts;  ///< by id
};

/// A folder with a subfolder for each checkpoint: manifest.json, and a file of Batch::save() for each rank.
///
/// A file is written under another name, brought to the disk (fsync) and then renamed, so under its own name it is
/// whole. A checkpoint is complete when it has a manifest, which is written last. Whatever else there is in a
/// checkpoint's folder (a policy, a trainer's state) belongs to the checkpoint; write it before complete().
///
/// Thread-safety: functions may be called at once, by different ranks above all, but for one number complete() runs
/// alone and after all write()s.
class LOCKSTEP_API Checkpoints {
 public:
  /// Makes the folder, if there is none. complete() leaves the last `keep` complete checkpoints and removes those
  /// before them; 0: it removes none. Throws UsageError where that cannot be.
  explicit Checkpoints(std::filesystem::path folder, int keep = 2);

  /// The folder of checkpoint `number`, whether there is one or not.
  std::filesystem::path folder_of(std::uint64_t number) const;

  /// Writes the batch's environments as a part of checkpoint `number`, over an earlier part of the same ids. Throws
  /// UsageError if it cannot be written, if the checkpoint is complete already, and unless Batch::ids() count on from
  /// the first.
  template <class S>
  void write(std::uint64_t number, const Batch<S>& batch) const;

  /// Says that checkpoint `number` has all parts: those of these ranges, in any order. Reads them all, writes the
  /// manifest and removes older checkpoints. Throws UsageError where ranges overlap or leave a gap, and where a part is
  /// missing, damaged, or of another plan, precision or version than the others.
  Checkpoint complete(std::uint64_t number, std::span<const IdRange> ranges) const;

  /// The complete checkpoint of the highest number, if there is one. Those without a manifest do not count. Throws
  /// UsageError where that manifest is damaged.
  std::optional<Checkpoint> latest() const;
  /// Whether it has a manifest.
  bool is_complete(std::uint64_t number) const;
  /// Throws UsageError where there is none, or its manifest is damaged.
  Checkpoint open(std::uint64_t number) const;

  /// Puts the environments that Batch::ids() names into the batch, from whichever parts have them. Changes nothing and
  /// throws UsageError for another plan or precision, for ids that it does not have, and where one of the parts that it
  /// needs is damaged: other ranks may not notice, so ranks that meet restore by mpi::Ranks, or together.
  template <class S>
  void restore(const Checkpoint& checkpoint, Batch<S>& batch) const;

 private:
  std::filesystem::path folder_;
  int keep_;
};

extern template void Checkpoints::write(std::uint64_t, const Batch<float>&) const;
extern template void Checkpoints::write(std::uint64_t, const Batch<double>&) const;
extern template void Checkpoints::restore(const Checkpoint&, Batch<float>&) const;
extern template void Checkpoints::restore(const Checkpoint&, Batch<double>&) const;

}  // namespace lockstep
