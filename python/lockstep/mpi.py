# Batches of MPI ranks: actions go out, readings come together. SPDX-License-Identifier: Apache-2.0
"""For ranks that mpirun has started, by mpi4py (Debian: python3-mpi4py).

    from mpi4py import MPI
    ranks = Ranks(MPI.COMM_WORLD, batch)
    ranks.scatter(actions, batch.rows.q_target)    # [k, all environments] of rank 0
    batch.step(4)
    ranks.gather(batch.rows.q, readings)

Functions are collective: all ranks call them, in the same order. What is wrong on one rank raises on all of them, so
none waits for another that has raised.
"""

from __future__ import annotations

import pickle
import sys
from typing import Any, Callable, Optional, Sequence, TypeVar

import numpy as np
import numpy.typing as npt

from ._lockstep import Batch, __version__
from .errors import UsageError
from .ranks import Checkpoints, ids_of, require_partition

Job = TypeVar("Job")
Result = TypeVar("Result")
Rows = npt.NDArray[Any]

_SAME = "run the same program with the same model and settings on all ranks"


def together(comm: Any, act: Callable[[], Result]) -> Result:
    """What act() returns on this rank; it must not communicate. Raises UsageError on all ranks if it has raised on
    one, with the words of the lowest such rank."""
    result, said, cause = None, None, None
    try:
        result = act()
    except Exception as error:  # noqa: BLE001 - whatever it is, the others must know
        said, cause = f"{type(error).__name__}: {error}", error
    failed = [(rank, words) for rank, words in enumerate(comm.allgather(said)) if words is not None]
    if failed:
        rank, words = failed[0]
        raise UsageError(f"rank {rank} of {comm.size}", f"has failed: {words}",
                         "mend what it names; all ranks have stopped here", "usage.rank") from cause
    return result  # type: ignore[return-value]


def spread(comm: Any, jobs: Sequence[Job], act: Callable[[Job], Result]) -> list[Result]:
    """[act(job) for job in jobs] on all ranks, each of which has done its share: those that ids_of() gives it. For
    sweeps and populations whose jobs need nothing of each other; results are sent by pickle. On a terminal rank 0 tells
    how far it is. Raises UsageError on all ranks if a job has raised, with its number, its rank and its words; the
    other ranks go on to the end of their shares before that."""
    ranks = min(comm.size, len(jobs))
    first, count = ids_of(comm.rank, ranks, len(jobs)) if comm.rank < ranks else (len(jobs), 0)
    own: list[bytes] = []
    said = None
    told = comm.rank == 0 and sys.stderr.isatty()
    for place in range(first, first + count):
        try:
            own.append(pickle.dumps(act(jobs[place])))
        except Exception as error:  # noqa: BLE001 - the others must know
            share = f"its share: {first} to {first + count - 1}"
            said = f"job {place} of {len(jobs)} ({share}): {type(error).__name__}: {error}"
            break
        if told:
            print(f"\r{place + 1 - first} of {count} jobs of rank 0", end="", file=sys.stderr, flush=True)
    if told:
        print(file=sys.stderr)
    shares = comm.allgather((own, said))
    failed = [f"rank {rank} of {comm.size}, {words}" for rank, (_, words) in enumerate(shares) if words]
    if failed:
        raise UsageError("rank", "; ".join(failed), "mend what it names; the results of the other ranks are lost",
                         "usage.rank")
    return [pickle.loads(result) for results, _ in shares for result in results]


class Ranks:
    """The ranks of a communicator, each with a batch of its own. Raises UsageError on all ranks where versions of
    lockstep, plans or precisions differ, and unless the ids of the batches are ranges without gaps. Keeps a duplicate
    of the communicator until free()."""

    def __init__(self, comm: Any, batch: Batch) -> None:
        self.comm = comm.Dup()
        try:
            self._agree(batch)
        except UsageError:  # on all ranks
            self.free()
            raise

    def _agree(self, batch: Batch) -> None:
        own = together(self.comm, lambda: (__version__, batch.plan.hash, batch.dtype.str, *self._range_of(batch)))
        every = self.comm.allgather(own)
        for rank, other in enumerate(every):
            for what, first, its in zip(("version of lockstep", "plan", "precision"), every[0], other):
                if its != first:
                    raise UsageError("ids of ranks", f"rank {rank} has the {what} {its}, and rank 0 has {first}", _SAME,
                                     "usage.rank")
        self.ranges: list[tuple[int, int]] = [other[3:] for other in every]
        self.num_envs = sum(count for _, count in self.ranges)
        self._first = min(first for first, _ in self.ranges)
        require_partition(self.ranges, self.num_envs, self._first)  # the same on all ranks

    def free(self) -> None:
        """Ends the use of the communicator, on all ranks."""
        self.comm.Free()

    def scatter(self, all_rows: Optional[Rows], own: Rows, root: int = 0) -> None:
        """From `all_rows` of the root, [k, all environments] by id, to `own` of each rank, [k, its environments]. Both
        are arrays of one dtype with contiguous rows, as those of Batch.rows; elsewhere `all_rows` may be None."""
        self._exchange(all_rows, own, root, True)

    def gather(self, own: Rows, all_rows: Optional[Rows], root: int = 0) -> None:
        """The other way."""
        self._exchange(all_rows, own, root, False)

    def statistics(self, own: Rows) -> dict[str, npt.NDArray[np.float64]]:
        """mean, deviation, least and most, [k] each, of the rows of all ranks, on all ranks. Sums over ranks are in the
        order of MPI, so the last bits of mean and deviation depend on their number."""
        from mpi4py import MPI

        count = together(self.comm, lambda: len(own))
        count = self.comm.bcast(count)
        together(self.comm, lambda: self._require_rows("the rows of the rank", own, count, self._own_count()))

        def reduced(numbers: Rows, operation: Any) -> npt.NDArray[np.float64]:
            result = np.empty(count)
            self.comm.Allreduce(np.ascontiguousarray(numbers, np.float64), result, operation)
            return result

        mean = reduced(own.sum(axis=1, dtype=np.float64), MPI.SUM) / self.num_envs
        squares = reduced(np.square(own - mean[:, None]).sum(axis=1), MPI.SUM)
        return {"mean": mean, "deviation": np.sqrt(squares / self.num_envs),
                "least": reduced(own.min(axis=1), MPI.MIN), "most": reduced(own.max(axis=1), MPI.MAX)}

    def faults(self, batch: Batch) -> dict[str, Any]:
        """On all ranks: count, how many environments have each fault, by its code; id and explanation of the
        environment with the lowest id that has one, None and "" if none has."""
        totals: dict[str, int] = {}
        firsts = []
        for count, first in self.comm.allgather(together(self.comm, lambda: self._own_faults(batch))):
            for code, number in count.items():
                totals[code] = totals.get(code, 0) + number
            firsts += [first] if first else []
        lowest = min(firsts, default=(None, ""))
        return {"count": totals, "id": lowest[0], "explanation": lowest[1]}

    def checkpoint(self, checkpoints: Checkpoints, number: int, batch: Batch) -> None:
        """Writes a checkpoint of all ranks, which is complete when this returns."""
        together(self.comm, lambda: checkpoints.write(number, batch))
        together(self.comm, lambda: checkpoints.complete(number, self.ranges) if self.comm.rank == 0 else None)

    def restore(self, checkpoints: Checkpoints, batch: Batch) -> Optional[int]:
        """Puts the last complete checkpoint into the batches, whichever ranks wrote it. Returns its number, or None if
        there is none. Where one rank cannot restore, all raise, though others may have restored by then."""
        def last() -> Optional[int]:
            latest = checkpoints.latest() if self.comm.rank == 0 else None
            return latest.number if latest else None

        number: Optional[int] = self.comm.bcast(together(self.comm, last))
        if number is not None:
            there = number
            together(self.comm, lambda: checkpoints.restore(checkpoints.open(there), batch))
        return number

    def _own_count(self) -> int:
        rank: int = self.comm.rank
        return self.ranges[rank][1]

    @staticmethod
    def _own_faults(batch: Batch) -> tuple[dict[str, int], Optional[tuple[int, str]]]:
        places = [int(place) for place in np.flatnonzero(batch.fault)]
        count: dict[str, int] = {}
        for place in places:
            code = batch.fault_report(place)["code"]
            count[code] = count.get(code, 0) + 1
        return count, (int(batch.env_id[places[0]]), batch.explain_fault(places[0])) if places else None

    @staticmethod
    def _range_of(batch: Batch) -> tuple[int, int]:
        ids = batch.env_id.astype(np.int64)
        if (ids != ids[0] + np.arange(len(ids))).any():
            raise UsageError("ids of ranks", "do not count on from the first", "give the batch its first_id",
                             "usage.rank")
        return int(ids[0]), len(ids)

    @staticmethod
    def _require_rows(what: str, rows: Optional[Rows], count: int, columns: int) -> None:
        if rows is None or rows.shape != (count, columns) or rows.strides[1] != rows.itemsize or rows.strides[0] < 0:
            told = "None" if rows is None else f"{rows.shape} with the strides {rows.strides}"
            raise UsageError("ids of ranks", f"{what} are {told}, not {(count, columns)} with contiguous rows",
                             "give [k, environments], with as many rows on all ranks", "usage.rank")

    def _exchange(self, all_rows: Optional[Rows], own: Rows, root: int, out: bool) -> None:
        from mpi4py import MPI

        comm, is_root = self.comm, self.comm.rank == root
        count, dtype = comm.bcast(together(comm, lambda: (len(own), own.dtype.str)), root)

        def look() -> None:
            self._require_rows("the rows of the rank", own, count, self._own_count())
            if is_root:
                self._require_rows("the rows of all ranks", all_rows, count, self.num_envs)
            for rows, written in ((own, out), (all_rows, not out)) if is_root else ((own, out),):
                if rows is not None and rows.dtype.str != dtype:
                    raise UsageError("ids of ranks", f"the rows are of {rows.dtype.str}, those of the root of {dtype}",
                                     "give arrays of one dtype", "usage.rank")
                if rows is not None and written and not rows.flags.writeable:
                    raise UsageError("ids of ranks", "the rows are read-only", "give an array to write to",
                                     "usage.rank")

        together(comm, look)
        types, requests = [], []

        def post(rows: Rows, other: int, send: bool) -> None:
            # The datatype knows the strides, the buffer where the rows begin and end.
            kind = MPI.BYTE.Create_hvector(len(rows), rows.shape[1] * rows.itemsize, rows.strides[0]).Commit()
            types.append(kind)
            length = (len(rows) - 1) * rows.strides[0] + rows.shape[1] * rows.itemsize if len(rows) else 0
            buffer = [MPI.memory.fromaddress(rows.ctypes.data, length), 1, kind]
            requests.append(comm.Isend(buffer, other) if send else comm.Irecv(buffer, other))

        if is_root and all_rows is not None:
            for other, (first, its) in enumerate(self.ranges):
                post(all_rows[:, first - self._first : first - self._first + its], other, out)
        post(own, root, not out)
        MPI.Request.Waitall(requests)
        for kind in types:
            kind.Free()
