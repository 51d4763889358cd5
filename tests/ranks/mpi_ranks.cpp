// Run under mpirun: joins what the ranks have, and compares it with one process. SPDX-License-Identifier: Apache-2.0
//
// It prints what is wrong, and ends with 1 then.
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>

#include "lockstep/mpi.h"
#include "ranked.h"

namespace {

using namespace lockstep;
using Array = Batch<float>::Array;

int failures = 0;

void expect(bool holds, const char* what) {
  if (holds) return;
  ++failures;
  std::fprintf(stderr, "rank %d: FAILED: %s\n", mpi::rank_of(MPI_COMM_WORLD).rank, what);
}

void expect_refused(const std::function<void()>& act, const std::string& words) {
  try {
    act();
    expect(false, ("not refused: " + words).c_str());
  } catch (const UsageError& error) {
    if (std::string(error.what()).find(words) == std::string::npos) expect(false, error.what());
  }
}

// Actions that rank 0 makes for all go out, and readings come back.
void match_one_process(const Plan& plan, int environments) {
  const Rank own = mpi::rank_of(MPI_COMM_WORLD);
  Batch<float> batch = ranked::batch_of<float>(plan, ids_of(own, environments, 50));
  Batch<float> all = ranked::batch_of<float>(plan, {50, environments});
  const mpi::Ranks ranks(MPI_COMM_WORLD, batch);
  expect(ranks.environments() == environments, "the sum of the ranges");
  const int root = own.ranks - 1, dofs = plan.dofs();
  const bool is_root = own.rank == root;
  Array actions = is_root ? Array(dofs, environments) : Array(),
        readings = is_root ? Array(dofs, environments) : Array();
  for (unsigned update = 0; update < 10; ++update) {
    all.draw({all.position_targets().data(), all.position_targets().outerStride()}, dofs, update);
    if (is_root) actions = all.position_targets();
    ranks.scatter(actions, batch.position_targets(), root);
    batch.step(4), all.step(4);
    ranks.gather(batch.positions(), readings, root);
    if (is_root) expect((readings == all.positions()).all(), "what is gathered has the bytes of one process");
    const std::vector<mpi::RowStatistics> joined = ranks.statistics(batch.velocities());
    for (int d = 0; d < dofs; ++d) {
      const auto row = all.velocities().row(d).cast<double>().eval();
      expect(joined[d].least == row.minCoeff() && joined[d].most == row.maxCoeff(), "extremes");
      expect(std::abs(joined[d].mean - row.mean()) < 1e-9, "means");
      expect(std::abs(joined[d].deviation - std::sqrt((row - row.mean()).square().mean())) < 1e-9, "deviations");
    }
  }
  expect(ranks.faults(batch).count.empty(), "no faults");
  batch.positions()(0, batch.environments() - 1) = NAN;  // one on each rank
  batch.step();
  const mpi::FaultTotals faults = ranks.faults(batch);
  expect(faults.count.size() == 1 && faults.count.at(Fault::not_finite) == own.ranks, "a fault for each rank");
  expect(faults.first_id == 50u + static_cast<unsigned>(ranks.ranges()[0].count) - 1, "the first that has a fault");
  expect(faults.explanation.find(plan.dof_names()[0]) != std::string::npos, "the fault in words");
}

// Where one rank is wrong, all have its error.
void stop_together(const Plan& plan) {
  const Rank own = mpi::rank_of(MPI_COMM_WORLD);
  const bool last = own.rank == own.ranks - 1;
  const std::string named = "rank " + std::to_string(own.ranks - 1) + " of " + std::to_string(own.ranks);
  expect_refused(
      [&] {
        mpi::together(MPI_COMM_WORLD, [&] {
          if (last) throw std::runtime_error("no disk");
        });
      },
      named + ": has failed: no disk");
  const IdRange range = ids_of(own, 30);
  Batch<float> batch = ranked::batch_of<float>(plan, range);
  if (own.ranks > 1) {
    Model other = plan.model();
    other.gravity *= 0.5;
    const Plan differs = last ? compile(other, plan.settings()) : plan;
    expect_refused([&] { mpi::Ranks(MPI_COMM_WORLD, Batch<float>(differs, range.count, {.first_id = range.first})); },
                   "its plan is");
    const std::uint32_t first = range.first + (last ? 1 : 0);
    expect_refused([&] { mpi::Ranks(MPI_COMM_WORLD, Batch<float>(plan, range.count, {.first_id = first})); },
                   "no rank owns id " + std::to_string(ids_of({own.ranks - 1, own.ranks}, 30).first));
    expect_refused(
        [&] { mpi::Ranks(MPI_COMM_WORLD, Batch<float>(plan, range.count, {.first_id = last ? 0 : range.first})); },
        "both own id");
  }
  const mpi::Ranks ranks(MPI_COMM_WORLD, batch);
  Array all(plan.dofs(), 30);
  Array narrow(last ? 1 : plan.dofs(), range.count);
  if (plan.dofs() > 1 && own.ranks > 1) expect_refused([&] { ranks.statistics(narrow); }, "the rows of the rank are");
  if (plan.dofs() > 1) expect_refused([&] { ranks.gather(narrow, all); }, "the rows of");
  expect_refused([&] { ranks.scatter(Array(plan.dofs(), 29), batch.positions()); }, "the rows of all ranks are");
}

// The ranks write checkpoints, and go on from them as one process does, however many they were before.
void go_on(const Plan& plan, const std::filesystem::path& folder) {
  const Rank own = mpi::rank_of(MPI_COMM_WORLD);
  Batch<float> batch = ranked::batch_of<float>(plan, ids_of(own, 30)), all = ranked::batch_of<float>(plan, {0, 30});
  const mpi::Ranks ranks(MPI_COMM_WORLD, batch);
  if (own.rank == 0) std::filesystem::remove_all(folder);
  MPI_Barrier(MPI_COMM_WORLD);
  const Checkpoints checkpoints(folder);
  expect(!ranks.restore(checkpoints, batch), "there is no checkpoint yet");
  for (unsigned update = 0; update < 6; ++update) ranked::control(batch, update), ranked::control(all, update);
  ranks.checkpoint(checkpoints, 6, batch);
  const std::vector<std::byte> before = batch.save();
  ranked::control(batch, 6);
  expect(ranks.restore(checkpoints, batch) == 6u && batch.save() == before, "the ranks go back to their checkpoint");
  Batch<float> again = ranked::batch_of<float>(plan, ids_of({own.ranks - 1 - own.rank, own.ranks}, 30));
  checkpoints.restore(*checkpoints.latest(), again);
  Batch<float> alone = ranked::batch_of<float>(plan, {0, 30});
  checkpoints.restore(*checkpoints.latest(), alone);
  for (unsigned update = 6; update < 12; ++update) ranked::control(alone, update), ranked::control(all, update);
  expect(alone.save() == all.save(), "one process goes on from the checkpoint of all ranks");
  batch.ids()[0] += 1000;  // cannot be written, on one rank
  if (own.rank != 0) batch.ids()[0] -= 1000;
  expect_refused([&] { ranks.checkpoint(checkpoints, 7, batch); }, "rank 0 of");
  if (own.ranks == 1) return;
  // A part that one rank needs is damaged: all stop.
  MPI_Barrier(MPI_COMM_WORLD);
  if (own.rank == 0)
    std::filesystem::resize_file(checkpoints.folder_of(6) / checkpoints.latest()->parts.back().file, 100);
  MPI_Barrier(MPI_COMM_WORLD);
  batch.ids()[0] = ids_of(own, 30).first;
  expect_refused([&] { ranks.restore(checkpoints, batch); }, "is not as its manifest says");
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  const std::filesystem::path folder = argc > 1 ? argv[1] : "checkpoints";
  try {
    for (const Plan& plan : ranked::plans()) {
      if (plan.dofs() > 0) match_one_process(plan, 37), stop_together(plan);
      go_on(plan, folder / plan.model().name);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    MPI_Abort(MPI_COMM_WORLD, 1);
  }
  MPI_Allreduce(MPI_IN_PLACE, &failures, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  if (failures == 0 && mpi::rank_of(MPI_COMM_WORLD).rank == 0) std::puts("ok");
  MPI_Finalize();
  return failures == 0 ? 0 : 1;
}
