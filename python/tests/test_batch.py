# SPDX-License-Identifier: Apache-2.0
import gc
import multiprocessing
import os
import sys
import threading
import weakref

import numpy as np
import pytest
from conftest import MODELS, VARIED, gripper_model

import lockstep as ls

FIELDS = ["q", "qd", "q_target", "qd_target", "effort"]


def test_views_are_live_and_share_memory(batch):
    for name in FIELDS:
        view, rows = getattr(batch, name), getattr(batch.rows, name)
        assert view.shape == (9, 9) and view.dtype == np.float32
        view[3, 2] = 0.25
        assert rows[2, 3] == 0.25 and getattr(batch, name)[3, 2] == 0.25
        assert np.shares_memory(view, rows) and np.shares_memory(view, batch.bind(name))
    before = batch.q.copy()
    held = batch.q
    batch.step(3)
    assert not np.array_equal(held, before) and np.array_equal(held, batch.q)


def test_setters_copy_and_check_shapes(batch):
    batch.q += 0.125
    assert batch.q[0, 0] == 0.125
    batch.q_target = np.full((9, 9), 0.5)
    assert np.all(batch.q_target == 0.5)
    batch.effort = 0
    with pytest.raises(ValueError):
        batch.q = np.zeros((9, 10))
    batch.rows.qd = np.ones((9, 9))
    assert np.all(batch.qd == 1)


def test_counts_are_read_only(batch):
    batch.step(5)
    assert np.all(batch.steps == 5) and batch.steps.dtype == np.int32
    batch.reset([2])
    assert batch.steps[2] == 0 and batch.episode.tolist() == [0, 0, 1, 0, 0, 0, 0, 0, 0]
    for name in ("fault", "steps"):
        with pytest.raises(ValueError):
            getattr(batch, name)[0] = 1
        with pytest.raises(AttributeError):
            setattr(batch, name, 0)


def test_parameters(batch, plan):
    ratios = batch.parameter("gear_ratio")
    assert ratios.shape == (9, 5) and np.shares_memory(ratios, batch.expand("gear_ratio"))
    assert batch.rows.parameter("gear_ratio").shape == (5, 9)
    with pytest.raises(ls.UsageError, match="declared"):
        batch.parameter("damping")
    with pytest.raises(ls.SettingsError, match="gear_ratio"):
        batch.parameter("gears")


def test_couplings_hold_at_changed_ratios(batch):
    batch.randomize("gear_ratio", "scale", 0.9, 1.1)
    batch.reset_random(spread=0.8)
    assert np.abs(batch.coupling_error()).max() < 1e-6
    batch.q_target[:, 3] = 0.5
    batch.step(50)
    assert np.abs(batch.coupling_error()).max() < 1e-6 and not batch.fault.any()


def test_which_environments(batch):
    batch.q = 1.0
    batch.reset(np.arange(9) == 4)
    batch.reset([0, -0, np.int64(8)])
    batch.reset([])
    batch.reset(np.zeros(9, bool))
    assert np.flatnonzero(batch.q[:, 0] == 0).tolist() == [0, 4, 8]
    table = np.arange(27).reshape(9, 3)
    for ids in (np.arange(9)[::4], np.arange(9)[::-4], table[[0, 1, 2], 1], np.nonzero(np.eye(9)[[3, 7]])[1]):
        episode = batch.episode.copy()
        batch.reset(ids[ids < 9])
        assert np.flatnonzero(batch.episode - episode).tolist() == sorted(ids[ids < 9])
    batch.q[[1, 2, 3, 5, 6, 7]] = 1
    batch.reset([0, 4, 8])
    for wrong, kind in (
        (np.ones(9, np.uint8), TypeError),
        (np.ones(9, np.int8), TypeError),
        ([1.5], TypeError),
        ([9], ls.UsageError),
        ([-1], IndexError),
        ([2**33], IndexError),
        (np.ones(8, bool), ls.UsageError),
        ([[1], [2]], TypeError),
        ("all", TypeError),
    ):
        with pytest.raises(kind):
            batch.reset(wrong)
    assert np.flatnonzero(batch.q[:, 0] == 0).tolist() == [0, 4, 8]


def test_reset_to_given_states(batch, plan):
    q = np.linspace(0, 0.3, 18).reshape(2, 9)
    assert batch.reset([1, 5], q) == []
    knuckle, tip = plan.dof("knuckle"), plan.dof("left_tip_joint")
    assert batch.q[5, knuckle] == np.float32(q[1, knuckle]) == -batch.q[5, tip]
    batch.reset([2], q[0], project=False)
    assert np.array_equal(batch.q[2], q[0].astype(np.float32))
    batch.reset([1, 5], batch.q[[5, 1]])  # its own views
    assert batch.q[1, knuckle] == np.float32(q[1, knuckle])
    with pytest.raises(ls.UsageError, match="shape"):
        batch.reset([1], np.zeros(8))
    batch.q_target[3] = 0.4
    batch.reset([3], keep_inputs=True)
    assert batch.q_target[3, 0] == np.float32(0.4)


def test_faults_stay_alone_and_explain_themselves(batch):
    other = batch.plan.batch(9, threads=1, seed=7)
    batch.q[4, 2] = np.nan
    for b in (batch, other):
        b.step(3)
    assert np.flatnonzero(batch.fault).tolist() == [4]
    assert "not_finite" in batch.explain_fault(4) and batch.explain_fault(3) == ""
    assert batch.fault_report(4)["code"] == "fault.not_finite"
    assert batch.fault_report(4)["fault"] == "not_finite" and batch.fault_report(4)["step"] == 0
    keep = np.arange(9) != 4
    assert np.array_equal(batch.q[keep], other.q[keep])
    batch.reset([4])
    assert not batch.fault.any()


def test_wrong_calls(batch, plan):
    for steps in (0, -3):
        with pytest.raises(ValueError):
            batch.step(steps)
    with pytest.raises(TypeError):
        ls.Batch()
    with pytest.raises(TypeError):
        type("Mine", (ls.Batch,), {})
    for wrong in ({"num_envs": 0}, {"num_envs": 1, "threads": -1}, {"num_envs": 1, "dtype": "i4"},
                  {"num_envs": 1, "engine": "magic"}):
        with pytest.raises(ls.SettingsError):
            plan.batch(**wrong)


def test_views_keep_the_batch_alive(plan):
    batch = plan.batch(64, threads=1)
    view, row = batch.q, batch.rows.parameter("mass")[1]
    del batch
    gc.collect()
    for i in range(1000):
        view[i % 64] = i
        row += 1
    assert view[999 % 64, 0] == 999


def test_batches_are_freed(plan):
    class Holder:
        pass

    holder = Holder()
    holder.batch = plan.batch(64, threads=1)
    holder.view = holder.batch.q
    gone = weakref.ref(holder)
    del holder
    gc.collect()
    assert gone() is None


def test_the_lock_of_python_is_free_while_a_batch_steps(plan):
    batch = plan.batch(4096, threads=1)
    done = threading.Event()
    worker = threading.Thread(target=lambda: (batch.step(2000), done.set()))
    worker.start()
    count = 0
    while not done.is_set():
        count += 1
    worker.join()
    assert count > 1000


def test_a_second_thread_is_refused_or_waits(plan):
    batch = plan.batch(4096, threads=1)
    refused = []

    def attempt(call, *arguments):
        try:
            call(*arguments)
        except ls.UsageError as error:
            refused.append(str(error))

    worker = threading.Thread(target=attempt, args=(batch.step, 2000))
    worker.start()
    while worker.is_alive():  # whoever comes second is refused
        attempt(batch.step)
        attempt(batch.reset, [0])
    worker.join()
    assert refused and all("same time" in message for message in refused)


def test_views_do_not_leak(batch):
    batch.step()
    resident = lambda: int(open("/proc/self/statm").read().split()[1]) * 4096  # noqa: E731
    sizes = []
    for _ in range(6):
        for _ in range(20000):
            batch.q, batch.fault, batch.rows.q
        for _ in range(2000):
            batch.coupling_error(), batch.save()
        sizes.append(resident())
    # The kernel counts pages roughly, on many cores by megabytes. A leak is there in every round.
    assert min(np.diff(sizes)) < 1 << 20


def test_a_forked_process_steps_too(plan):
    batch = plan.batch(64, threads=2)
    batch.step(2)
    child = os.fork()
    if child == 0:
        batch.step(10)
        os._exit(0 if np.all(batch.steps == 12) else 1)
    assert os.waitpid(child, 0)[1] == 0
    batch.step(1)
    assert np.all(batch.steps == 3)


def test_a_spawned_process_gets_plan_and_state(plan):
    batch = plan.batch(5, seed=1)
    batch.reset_random()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        there = pool.apply(stepped, (plan, batch.save(), 30))
    batch.step(30)
    assert np.array_equal(there, batch.q)


def stepped(plan, blob, steps):
    batch = plan.batch(5)
    batch.restore(blob)
    batch.step(steps)
    return batch.q.copy()


def test_sub_interpreters_are_refused():
    interpreters = pytest.importorskip("_xxsubinterpreters")
    other = interpreters.create()
    paths = repr([path for path in sys.path])
    with pytest.raises(interpreters.RunFailedError, match="main interpreter"):
        interpreters.run_string(other, f"import sys; sys.path = {paths}\nimport lockstep._lockstep")
    interpreters.destroy(other)


def test_arrays_are_shared_with_torch(batch):
    torch = pytest.importorskip("torch")
    tensor = torch.from_dlpack(batch.q)
    tensor[3, 2] = 0.75
    assert batch.q[3, 2] == 0.75


def test_precisions_and_engines(plan):
    double = plan.batch(3, dtype=np.float64, threads=1)
    assert double.q.dtype == np.float64 == double.dtype
    ends = []
    for engine in ("tables", "compiled"):
        b = plan.batch(3, dtype="f8", threads=1, engine=engine)
        assert b.engine == engine
        b.q_target[:, :4] = 0.3
        b.step(100)
        ends.append(b.q.copy())
    assert np.allclose(*ends, atol=1e-10)


def test_a_generated_kernel_is_loaded_from_a_file():
    kernel = os.environ.get("LOCKSTEP_TEST_KERNEL")
    if not kernel:
        pytest.skip("no kernel was built")
    plan = ls.compile(ls.from_urdf(MODELS / "prismatic_pair.urdf"))
    before = plan.batch(3)
    assert before.engine != "generated" and before.kernel == ""
    ls.load_kernel(kernel)
    after = plan.batch(3)
    assert after.engine == "generated" and after.kernel == "prismatic_pair"
    for batch in (before, after):
        batch.qd[:, 0] = 0.1
        batch.step(20)
    assert np.allclose(before.q, after.q, atol=1e-6) and np.abs(after.q).max() > 1e-3
    with pytest.raises(ls.UsageError, match="cannot be loaded"):
        ls.load_kernel("/no/such/kernel.so")


def test_edits_need_no_announcement():
    plan = ls.compile(gripper_model(), vary=VARIED)
    late, early = plan.batch(5, threads=1), plan.batch(5, threads=1)
    late.step(50)
    for b in (late, early):
        b.parameter("mass")[...] *= 1.5
        b.parameter("gear_ratio")[:, 0] = -0.9
        b.reset()
        b.q_target[:, :4] = 0.3
        b.step(100)
    assert np.array_equal(late.q, early.q)
