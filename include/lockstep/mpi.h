// Batches of MPI ranks: actions go out, readings come together. SPDX-License-Identifier: Apache-2.0
//
// For programs that link lockstep::mpi. Each rank owns a range of the environments, and nothing of their state ever
// leaves it. What goes between the ranks goes straight from rows to rows, by derived datatypes, without a copy of ours.
//
//     mpi::Ranks ranks(MPI_COMM_WORLD, batch);             // the batch has ids_of(mpi::rank_of(comm), ...)
//     ranks.scatter(actions, batch.position_targets());    // [dofs][all environments] of rank 0
//     batch.step(4);
//     ranks.gather(batch.positions(), readings);
//
// All functions are collective: all ranks call them, in the same order. What is wrong on one rank is an error on all,
// so none waits for another that has thrown.
#pragma once

#include <mpi.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "lockstep/batch.h"
#include "lockstep/checkpoints.h"
#include "lockstep/error.h"
#include "lockstep/plan.h"
#include "lockstep/ranks.h"
#include "lockstep/version.h"

namespace lockstep::mpi {

inline Rank rank_of(MPI_Comm comm) {
  Rank own;
  MPI_Comm_rank(comm, &own.rank), MPI_Comm_size(comm, &own.ranks);
  return own;
}

/// Calls act() on each rank; it must not communicate. Throws UsageError on all ranks if it has thrown on one, with the
/// words of the lowest such rank.
template <class Act>
void together(MPI_Comm comm, const Act& act) {
  const Rank own = rank_of(comm);
  std::string said;
  int failed = own.ranks;
  try {
    act();
  } catch (const std::exception& error) {
    said = error.what(), failed = own.rank;
  } catch (...) {
    said = "what it threw is no std::exception", failed = own.rank;
  }
  int first = failed;
  MPI_Allreduce(&failed, &first, 1, MPI_INT, MPI_MIN, comm);
  if (first == own.ranks) return;
  int length = static_cast<int>(said.size());
  MPI_Bcast(&length, 1, MPI_INT, first, comm);
  said.resize(static_cast<std::size_t>(length));
  MPI_Bcast(said.data(), length, MPI_CHAR, first, comm);
  throw UsageError("rank " + std::to_string(first) + " of " + std::to_string(own.ranks), "has failed: " + said,
                   "mend what it names; all ranks have stopped here");
}

/// Of one row over all environments. Sums over ranks are in the order of MPI, so the last bits depend on their number.
struct RowStatistics {
  double mean = 0.0, deviation = 0.0;  ///< the standard deviation, of all
  double least = 0.0, most = 0.0;
};

/// Of all environments.
struct FaultTotals {
  std::map<Fault, std::int64_t> count;  ///< those that have one
  std::uint32_t first_id = 0;           ///< of the environment with the lowest id that has one
  std::string explanation;              ///< Batch::explain_fault() of it; empty if none has
};

/// The ranks of a communicator, each with a batch of its own. Keeps a duplicate of the communicator, so that its
/// messages meet no others. To be destroyed before MPI_Finalize().
class Ranks {
 public:
  /// Throws UsageError on all ranks, with their numbers, where versions of lockstep, plans or precisions differ, and
  /// unless the batches' ids are ranges that follow each other without gaps.
  template <class S>
  Ranks(MPI_Comm comm, const Batch<S>& batch) {
    MPI_Comm_dup(comm, &comm_);
    rank_ = rank_of(comm_);
    try {
      agree(batch);
    } catch (...) {
      MPI_Comm_free(&comm_);
      throw;
    }
  }
  ~Ranks() { MPI_Comm_free(&comm_); }
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  Rank rank() const { return rank_; }
  /// Of all ranks, in their order.
  const std::vector<IdRange>& ranges() const { return ranges_; }
  /// Of all ranks together.
  std::int64_t environments() const {
    std::int64_t sum = 0;
    for (const IdRange& range : ranges_) sum += range.count;
    return sum;
  }

  /// From the root's `all`, [rows][all environments] by id, to each rank's `own`, [rows][its environments]. Both are
  /// row-major arrays, maps or views of Eigen with the same scalar; elsewhere than on the root `all` may be empty.
  template <class All, class Own>
  void scatter(const Eigen::DenseBase<All>& all, Own&& own, int root = 0) const {
    exchange<true>(all.derived(), own, root);
  }
  /// The other way.
  template <class Own, class All>
  void gather(const Eigen::DenseBase<Own>& own, All&& all, int root = 0) const {
    exchange<false>(all, own.derived(), root);
  }

  /// Of each row of an array [rows][the rank's environments], on all ranks.
  template <class Own>
  std::vector<RowStatistics> statistics(const Eigen::DenseBase<Own>& own) const {
    std::int64_t common = own.rows();
    MPI_Bcast(&common, 1, MPI_INT64_T, 0, comm_);
    together(comm_, [&] { require_shape("the rows of the rank", own, common, own_count()); });
    const auto rows = static_cast<std::size_t>(common);
    const int count = static_cast<int>(rows);
    std::vector<double> sums(rows), squares(rows), least(rows), most(rows);
    for (std::size_t r = 0; r < rows; ++r) {
      const auto row = own.derived().row(static_cast<Eigen::Index>(r)).template cast<double>().eval();
      sums[r] = row.sum(), least[r] = -row.minCoeff(), most[r] = row.maxCoeff();
    }
    const auto reduce = [&](std::vector<double>& numbers, MPI_Op operation) {
      MPI_Allreduce(MPI_IN_PLACE, numbers.data(), count, MPI_DOUBLE, operation, comm_);
    };
    reduce(sums, MPI_SUM), reduce(least, MPI_MAX), reduce(most, MPI_MAX);
    const double all = static_cast<double>(environments());
    for (std::size_t r = 0; r < rows; ++r) {
      const auto row = own.derived().row(static_cast<Eigen::Index>(r)).template cast<double>();
      squares[r] = (row - sums[r] / all).square().sum();
    }
    reduce(squares, MPI_SUM);
    std::vector<RowStatistics> statistics(rows);
    for (std::size_t r = 0; r < rows; ++r)
      statistics[r] = {sums[r] / all, std::sqrt(squares[r] / all), -least[r], most[r]};
    return statistics;
  }

  /// On all ranks.
  template <class S>
  FaultTotals faults(const Batch<S>& batch) const {
    std::array<std::int64_t, fault_kinds> counts{};
    std::int64_t first = std::numeric_limits<std::int64_t>::max();
    int place = -1;
    for (int e = 0; e < batch.environments(); ++e) {
      const Fault fault = batch.faults()[e];
      if (fault == Fault::none) continue;
      ++counts[static_cast<std::size_t>(fault)];
      if (batch.ids()[e] < first) first = batch.ids()[e], place = e;
    }
    MPI_Allreduce(MPI_IN_PLACE, counts.data(), fault_kinds, MPI_INT64_T, MPI_SUM, comm_);
    const std::int64_t own = first;
    MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT64_T, MPI_MIN, comm_);
    FaultTotals totals;
    for (int kind = 0; kind < fault_kinds; ++kind)
      if (counts[static_cast<std::size_t>(kind)] > 0)
        totals.count[static_cast<Fault>(kind)] = counts[static_cast<std::size_t>(kind)];
    if (totals.count.empty()) return totals;
    totals.first_id = static_cast<std::uint32_t>(first);
    int owner = own == first ? rank_.rank : rank_.ranks;
    MPI_Allreduce(MPI_IN_PLACE, &owner, 1, MPI_INT, MPI_MIN, comm_);
    together(comm_, [&] { totals.explanation = own == first ? batch.explain_fault(place) : ""; });
    broadcast(totals.explanation, owner);
    return totals;
  }

  /// Writes a checkpoint of all ranks, which is complete when this returns.
  template <class S>
  void checkpoint(const Checkpoints& checkpoints, std::uint64_t number, const Batch<S>& batch) const {
    together(comm_, [&] { checkpoints.write(number, batch); });
    together(comm_, [&] {
      if (rank_.rank == 0) checkpoints.complete(number, ranges_);
    });
  }

  /// Puts the last complete checkpoint into the batches, on whichever ranks wrote it. Returns its number, or nothing if
  /// there is none. Where one rank cannot restore, all throw, though others may have restored by then.
  template <class S>
  std::optional<std::uint64_t> restore(const Checkpoints& checkpoints, Batch<S>& batch) const {
    std::uint64_t last[2] = {0, 0};  // whether there is one, its number
    together(comm_, [&] {
      if (rank_.rank != 0) return;
      if (const std::optional<Checkpoint> latest = checkpoints.latest()) last[0] = 1, last[1] = latest->number;
    });
    MPI_Bcast(last, 2, MPI_UINT64_T, 0, comm_);
    if (last[0] == 0) return std::nullopt;
    together(comm_, [&] { checkpoints.restore(checkpoints.open(last[1]), batch); });
    return last[1];
  }

 private:
  static constexpr int fault_kinds = static_cast<int>(fault_count);

  template <class S>
  static MPI_Datatype type_of() {
    static_assert(std::is_same_v<S, float> || std::is_same_v<S, double>, "rows are of float or double");
    return std::is_same_v<S, float> ? MPI_FLOAT : MPI_DOUBLE;
  }

  // [rows][count] within rows that begin `stride` numbers apart.
  class Block {
   public:
    Block(MPI_Datatype number, std::size_t number_bytes, std::int64_t rows, int count, Eigen::Index stride) {
      MPI_Type_create_hvector(static_cast<int>(rows), count,
                              static_cast<MPI_Aint>(stride) * static_cast<MPI_Aint>(number_bytes), number, &type_);
      MPI_Type_commit(&type_);
    }
    ~Block() { MPI_Type_free(&type_); }
    Block(const Block&) = delete;
    Block& operator=(const Block&) = delete;
    operator MPI_Datatype() const { return type_; }

   private:
    MPI_Datatype type_ = MPI_DATATYPE_NULL;
  };

  void broadcast(std::string& text, int from) const {
    int length = static_cast<int>(text.size());
    MPI_Bcast(&length, 1, MPI_INT, from, comm_);
    text.resize(static_cast<std::size_t>(length));
    MPI_Bcast(text.data(), length, MPI_CHAR, from, comm_);
  }

  // What each rank has; throws on all where a rank has another than rank 0.
  void require_same(const char* what, std::string own) const {
    std::string first = own;
    broadcast(first, 0);
    together(comm_, [&] {
      if (own != first)
        throw UsageError(std::string("ids of ranks"),
                         std::string("its ") + what + " is " + own + ", and that of rank 0 is " + first,
                         "run the same program with the same model and settings on all ranks");
    });
  }

  template <class S>
  void agree(const Batch<S>& batch) {
    require_same("version of lockstep", version());
    require_same("plan", std::to_string(batch.plan().hash()));
    require_same("precision", std::to_string(8 * sizeof(S)) + " bits");
    const auto ids = batch.ids();
    together(comm_, [&] {
      for (std::size_t e = 1; e < ids.size(); ++e)
        if (ids[e] != ids[0] + e)
          throw UsageError("ids of ranks", "do not count on from the first",
                           "give the batch its BatchOptions::first_id");
    });
    const std::int64_t own[2] = {ids[0], batch.environments()};
    std::vector<std::int64_t> all(2 * static_cast<std::size_t>(rank_.ranks));
    MPI_Allgather(own, 2, MPI_INT64_T, all.data(), 2, MPI_INT64_T, comm_);
    for (std::size_t rank = 0; rank < all.size(); rank += 2) {
      ranges_.push_back({static_cast<std::uint32_t>(all[rank]), static_cast<int>(all[rank + 1])});
      first_ = std::min(first_, all[rank]);
    }
    require_partition(ranges_, environments(), static_cast<std::uint32_t>(first_));  // the same on all ranks
  }

  int own_count() const { return ranges_[static_cast<std::size_t>(rank_.rank)].count; }

  template <class Rows>
  static void require_shape(const std::string& what, const Rows& rows, std::int64_t count, std::int64_t columns) {
    const auto shape = [](std::int64_t r, std::int64_t c) { return std::to_string(r) + " x " + std::to_string(c); };
    if (rows.rows() != count || rows.cols() != columns || rows.derived().innerStride() != 1)
      throw UsageError("ids of ranks",
                       what + " are " + shape(rows.rows(), rows.cols()) + ", not " + shape(count, columns),
                       "give [rows][environments], with as many rows on all ranks");
  }

  // Out: from the root's `all` to `own` of each rank; else the other way.
  template <bool out, class All, class Own>
  void exchange(All& all, Own& own, int root) const {
    using S = typename std::remove_cvref_t<Own>::Scalar;
    static_assert(std::is_same_v<S, typename std::remove_cvref_t<All>::Scalar>, "both have the same scalar");
    static_assert(std::remove_cvref_t<Own>::IsRowMajor && std::remove_cvref_t<All>::IsRowMajor, "rows are contiguous");
    std::int64_t rows = own.rows();
    MPI_Bcast(&rows, 1, MPI_INT64_T, root, comm_);
    together(comm_, [&] {
      require_shape("the rows of the rank", own, rows, own_count());
      if (rank_.rank == root) require_shape("the rows of all ranks", all, rows, environments());
    });
    std::vector<MPI_Request> requests;
    std::vector<std::unique_ptr<Block>> blocks;
    const auto block = [&](int count, Eigen::Index stride) -> MPI_Datatype {
      requests.emplace_back();
      blocks.push_back(std::make_unique<Block>(type_of<S>(), sizeof(S), rows, count, stride));
      return *blocks.back();
    };
    const auto send = [&](const S* data, MPI_Datatype type, int to) {
      MPI_Isend(data, 1, type, to, 0, comm_, &requests.back());
    };
    const auto receive = [&](S* data, MPI_Datatype type, int from) {
      MPI_Irecv(data, 1, type, from, 0, comm_, &requests.back());
    };
    for (int other = 0; rank_.rank == root && other < rank_.ranks; ++other) {
      const IdRange& range = ranges_[static_cast<std::size_t>(other)];
      const MPI_Datatype type = block(range.count, all.outerStride());
      auto* const theirs = all.data() + (range.first - first_);
      if constexpr (out)
        send(theirs, type, other);
      else
        receive(theirs, type, other);
    }
    const MPI_Datatype type = block(own_count(), own.outerStride());
    if constexpr (out)
      receive(own.data(), type, root);
    else
      send(own.data(), type, root);
    MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
  }

  MPI_Comm comm_ = MPI_COMM_NULL;
  Rank rank_;
  std::vector<IdRange> ranges_;
  std::int64_t first_ = std::int64_t{1} << 32;  // the lowest id
};

}  // namespace lockstep::mpi
