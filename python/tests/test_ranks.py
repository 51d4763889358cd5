# Ranks: shares, checkpoints, MPI. SPDX-License-Identifier: Apache-2.0
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import lockstep as ls
from lockstep.ranks import Checkpoints, ids_of, rank_of_launcher, require_partition

EXAMPLES = pathlib.Path(__file__).parents[2] / "docs" / "examples" / "python"
MPIRUN = shutil.which("mpirun")


def test_ranks_share_all_environments(monkeypatch):
    shares = [ids_of(rank, 3, 10, first_id=5) for rank in range(3)]
    assert shares == [(5, 4), (9, 3), (12, 3)]
    require_partition(shares[::-1], 10, first_id=5)
    with pytest.raises(ls.UsageError, match="no rank owns ids 9 to 11"):
        require_partition([shares[0], shares[2]], 10, first_id=5)
    with pytest.raises(ls.UsageError, match="is 3 of 3"):
        ids_of(3, 3, 10)
    for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("RANK", "1"), monkeypatch.setenv("WORLD_SIZE", "4")
    assert rank_of_launcher() == (1, 4)


def test_checkpoints_go_on_anywhere(plan, tmp_path):
    def run(batch, updates):
        for update in updates:
            batch.q_target[:] = batch.draw(plan.nv, stream=update) - 0.5
            batch.step(4)

    def batch_of(first_id, num_envs):
        batch = plan.batch(num_envs, first_id=first_id, threads=1, seed=3)
        batch.reset_random(spread=0.3)
        return batch

    checkpoints = Checkpoints(tmp_path / "run", keep=1)
    assert checkpoints.latest() is None
    alone = batch_of(0, 10)
    run(alone, range(8))
    for rank in range(3):
        batch = batch_of(*ids_of(rank, 3, 10))
        run(batch, range(4))
        checkpoints.write(4, batch)
    done = checkpoints.complete(4, [ids_of(rank, 3, 10) for rank in range(3)])
    assert (done.number, done.ranges, done.plan_hash) == (4, [(0, 4), (4, 3), (7, 3)], plan.hash)
    for rank in range(2):
        first_id, num_envs = ids_of(rank, 2, 10)
        batch = batch_of(first_id, num_envs)
        checkpoints.restore(checkpoints.latest(), batch)
        run(batch, range(4, 8))
        assert np.array_equal(batch.q, alone.q[first_id : first_id + num_envs])
    with pytest.raises(ls.UsageError, match="does not exist"):
        checkpoints.complete(5, [(0, 10)])
    assert checkpoints.folder_of(4).name == "000000000004"


def mpirun(ranks, *command, **how):
    environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return subprocess.Popen([MPIRUN, "-n", str(ranks), "--oversubscribe", sys.executable, *map(str, command)],
                            env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **how)


def finished(process):
    said, _ = process.communicate(timeout=100)
    assert process.returncode == 0, said
    return said


@pytest.fixture
def mpi():
    pytest.importorskip("mpi4py")
    if not MPIRUN:
        pytest.skip("there is no mpirun (Debian: openmpi-bin)")


def test_ranks_of_mpi_give_the_bytes_of_one_process(mpi, tmp_path):
    results = []
    for ranks in (1, 2, 3, 4):
        folder = tmp_path / str(ranks)
        said = finished(mpirun(ranks, EXAMPLES / "ranks.py", "--folder", folder, "--envs", 50, "--updates", 20))
        assert f"on {ranks} ranks" in said and "faults: none" in said
        results.append((folder / "positions.npy").read_bytes())
    assert all(result == results[0] for result in results)


def test_a_killed_run_goes_on_from_its_last_checkpoint_on_other_ranks(mpi, tmp_path):
    common = ("--envs", 50, "--updates", 400)
    finished(mpirun(1, EXAMPLES / "ranks.py", "--folder", tmp_path / "whole", *common))
    folder = tmp_path / "killed"
    running = mpirun(3, EXAMPLES / "ranks.py", "--folder", folder, *common)
    checkpoints, last = Checkpoints(folder), None
    while not last and running.poll() is None:
        time.sleep(0.002)
        last = checkpoints.latest()
    ranks = [int(pid) for pid in pathlib.Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()]
    os.kill(ranks[1], signal.SIGKILL)
    said, _ = running.communicate(timeout=100)
    assert running.returncode != 0, said
    assert not (folder / "positions.npy").exists()
    left = checkpoints.latest().number
    assert 10 <= left < 400
    said = finished(mpirun(2, EXAMPLES / "ranks.py", "--folder", folder, *common))
    assert f"updates {left} to 400" in said
    assert (folder / "positions.npy").read_bytes() == (tmp_path / "whole" / "positions.npy").read_bytes()


def test_a_population_that_ranks_share_finds_the_same(mpi):
    command = (EXAMPLES / "identify_cma.py", "--generations", 10)
    alone = subprocess.run([sys.executable, *map(str, command)], capture_output=True, text=True, check=True).stdout
    assert "generation  10" in alone
    assert finished(mpirun(3, *command, "--mpi")) == alone


WRONG = """
import numpy as np
import lockstep as ls
from mpi4py import MPI
from lockstep.mpi import Ranks, spread, together
from lockstep.ranks import ids_of

comm = MPI.COMM_WORLD
last = comm.rank == comm.size - 1


def refused(words, act):
    try:
        act()
    except ls.UsageError as error:
        assert words in str(error) and error.code == "usage.rank", str(error)
    else:
        raise AssertionError(f"taken: {words}")


def plan_of(gravity):
    model = ls.from_urdf(%r)
    model.gravity = (0, 0, gravity)
    return ls.compile(model)


def batch_of(plan, shift=0, **how):
    first_id, num_envs = ids_of(comm.rank, comm.size, 20)
    return plan.batch(num_envs, first_id=first_id + shift, threads=1, **how)


plan = plan_of(-9.81)
refused(f"rank {comm.size - 1} of {comm.size}: has failed: ZeroDivisionError", lambda: together(comm, lambda: 1 // (not last)))
refused("has the plan", lambda: Ranks(comm, batch_of(plan_of(-1.62 if last else -9.81))))
refused("has the precision", lambda: Ranks(comm, batch_of(plan, dtype="f8" if last else "f4")))
refused("no rank owns id", lambda: Ranks(comm, batch_of(plan, shift=int(last))))
refused("both own id", lambda: Ranks(comm, batch_of(plan, shift=-int(last))))
batch = batch_of(plan)
ranks = Ranks(comm, batch)
everything = np.zeros((plan.nv, 20), "f4") if comm.rank == 0 else None
refused("the rows of all ranks are", lambda: ranks.scatter(None, batch.rows.q_target))
refused("the rows of the rank are", lambda: ranks.gather(batch.q if last else batch.rows.q, everything))
refused("the rows are of", lambda: ranks.gather(batch.rows.q.astype("f8") if last else batch.rows.q, everything))
batch.rows.q[:] = np.arange(comm.rank, comm.rank + batch.num_envs)
told = ranks.statistics(batch.rows.q)
together(comm, lambda: None)
joined = np.concatenate(comm.allgather(batch.q[:, 0].astype("f8")))
assert np.allclose(told["mean"], joined.mean()) and np.allclose(told["deviation"], joined.std())
assert (told["least"] == joined.min()).all() and (told["most"] == joined.max()).all()
for count in (0, 1, 2, 10):
    assert spread(comm, list(range(count)), lambda job: job * job) == [job * job for job in range(count)]
refused("job 9 of 10 (its share: ", lambda: spread(comm, list(range(10)), lambda job: 1 // (9 - job)))
assert ranks.faults(batch) == {"count": {}, "id": None, "explanation": ""}
if last:
    batch.q[1, 0] = np.nan
batch.step()
faults = ranks.faults(batch)
assert faults["count"] == {"fault.not_finite": 1}, faults
assert faults["id"] == ids_of(comm.size - 1, comm.size, 20)[0] + 1 and faults["explanation"]
print("fine")
"""


def test_what_is_wrong_on_one_rank_raises_on_all(mpi, tmp_path):
    script = tmp_path / "wrong.py"
    script.write_text(WRONG % str(EXAMPLES.parents[2] / "tests" / "models" / "gripper.urdf"))
    assert finished(mpirun(3, script)).count("fine") == 3


def example(*command):
    done = subprocess.run([sys.executable, *map(str, command)], capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_halves_that_are_stepped_in_turn_move_as_the_whole():
    said = example(EXAMPLES / "overlap.py", "--envs", 64, "--updates", 8, "--rounds", 2, "--hidden", 16)
    assert "the same motion to the last bit" in said


def test_ranks_of_torch_learn_one_agent(mpi):
    pytest.importorskip("torch")
    said = finished(mpirun(2, EXAMPLES / "train_ppo_ranks.py", "--iterations", 11, "--envs", 128))
    first, last = (float(line.split()[-2]) for line in said.splitlines() if line.startswith("iteration"))
    assert last < 0.9 * first
    assert "rank 1 of 2: 64 environments from id 64 on, one agent" in said
