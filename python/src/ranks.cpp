// Which environments are whose, and checkpoints of several processes, for Python. SPDX-License-Identifier: Apache-2.0
#include "lockstep/ranks.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <vector>

#include "batch.h"
#include "lockstep/checkpoints.h"

namespace lockstep::python {
namespace {

using namespace pybind11::literals;

using Range = std::pair<std::uint32_t, int>;

std::vector<IdRange> ranges_of(const std::vector<Range>& given) {
  std::vector<IdRange> ranges;
  for (const auto& [first, count] : given) ranges.push_back({first, count});
  return ranges;
}

std::vector<Range> ranges_in(const Checkpoint& checkpoint) {
  std::vector<Range> ranges;
  for (const Checkpoint::Part& part : checkpoint.parts) ranges.emplace_back(part.ids.first, part.ids.count);
  return ranges;
}

}  // namespace

void bind_ranks(py::module_& module) {
  module.def(
      "rank_of_launcher",
      [] {
        const Rank own = rank_of_launcher();
        return std::pair(own.rank, own.ranks);
      },
      "(rank, ranks) of this process, as mpirun, torchrun or Slurm say in the environment; (0, 1) without a launcher.");
  module.def(
      "ids_of",
      [](int rank, int ranks, std::int64_t num_envs, std::uint32_t first_id) {
        const IdRange own = ids_of({rank, ranks}, num_envs, first_id);
        return Range(own.first, own.count);
      },
      "rank"_a, "ranks"_a, "num_envs"_a, "first_id"_a = 0,
      "(first_id, num_envs) of a rank that shares num_envs environments with the others: ranges that follow each "
      "other, in the order of the ranks, whose lengths differ by at most one.");
  module.def(
      "require_partition",
      [](const std::vector<Range>& by_rank, std::int64_t num_envs, std::uint32_t first_id) {
        require_partition(ranges_of(by_rank), num_envs, first_id);
      },
      "by_rank"_a, "num_envs"_a, "first_id"_a = 0,
      "Raises UsageError, with the numbers of the ranks, unless their ranges, (first_id, num_envs) each, are all "
      "environments once.");

  py::class_<Checkpoint> checkpoint(module, "Checkpoint", py::is_final(), "A checkpoint that is complete.");
  forbid_new(checkpoint);
  checkpoint.def_readonly("number", &Checkpoint::number, "as it was given")
      .def_readonly("version", &Checkpoint::version, "of lockstep, that wrote it")
      .def_readonly("plan_hash", &Checkpoint::plan_hash, "Plan.hash of its batches")
      .def_property_readonly("ranges", &ranges_in, "(first_id, num_envs) of each of its parts");

  py::class_<Checkpoints> checkpoints(
      module, "Checkpoints", py::is_final(),
      "A folder of checkpoints that ranks write together. Each rank writes its environments; when "
      "all have, one of them completes the checkpoint. What a killed rank leaves half done is "
      "never read. Any number of ranks goes on from one, with the same bits.");
  checkpoints
      .def(py::init<std::filesystem::path, int>(), "folder"_a, py::kw_only(), "keep"_a = 2,
           "Makes the folder. complete() leaves the last `keep` complete ones and removes those before; 0: none.")
      .def("folder_of", &Checkpoints::folder_of, "number"_a,
           "The folder of a checkpoint. What a trainer puts there before complete() belongs to it.")
      .def(
          "write",
          [](const Checkpoints& own, std::uint64_t number, AnyBatch& any) {
            any.use([&](auto& batch) { own.write(number, batch); });
          },
          "number"_a, "batch"_a, "Writes the batch's environments as a part of checkpoint `number`.")
      .def(
          "complete",
          [](const Checkpoints& own, std::uint64_t number, const std::vector<Range>& ranges) {
            return own.complete(number, ranges_of(ranges));
          },
          "number"_a, "ranges"_a,
          "Says that the parts of these ranges, (first_id, num_envs) each, are all of checkpoint `number`. Call it on "
          "one rank, after all have written. Raises UsageError where one is missing, damaged or of another plan.")
      .def("latest", &Checkpoints::latest, "The last one that is complete, or None.")
      .def("open", &Checkpoints::open, "number"_a, "A complete one.")
      .def(
          "restore",
          [](const Checkpoints& own, const Checkpoint& checkpoint, AnyBatch& any) {
            any.use([&](auto& batch) { own.restore(checkpoint, batch); });
          },
          "checkpoint"_a, "batch"_a, "Puts the environments of the batch's ids into it, whichever ranks wrote them.");
  construct_in_new(checkpoints);
}

}  // namespace lockstep::python
