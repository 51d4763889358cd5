"""What is no object of the library, or no number, is a TypeError. SPDX-License-Identifier: Apache-2.0"""
import copy
import os
import pickle

import numpy as np
import pytest

import lockstep as ls
from lockstep import _lockstep


@pytest.mark.parametrize("name", ["Batch", "Plan", "Rows", "_Motion"])
def test_no_object_is_made_past_the_library(name):
    kind = getattr(_lockstep, name)
    for make in (kind, lambda: kind.__new__(kind), lambda: object.__new__(kind)):
        with pytest.raises(TypeError):
            make()


def test_plans_and_batches_are_copied_and_rows_are_not(batch):
    batch.step(3)
    for twin in (copy.copy(batch), pickle.loads(pickle.dumps(batch))):
        assert np.array_equal(twin.q, batch.q)
    assert pickle.loads(pickle.dumps(batch.plan)).hash == batch.plan.hash
    with pytest.raises(TypeError, match="rows"):
        copy.copy(batch.rows)
    with pytest.raises(TypeError, match="rows"):
        pickle.dumps(batch.rows)


@pytest.mark.parametrize("what", [None, [None], "0.1", ["a"], [1j], object()])
def test_what_is_no_number_is_assigned_to_nothing(batch, what):
    before = np.array(batch.q)
    for own in (batch, batch.rows):
        for field in ("q", "qd", "q_target", "qd_target", "effort", "root_pose", "root_twist"):
            with pytest.raises(TypeError, match=field):
                setattr(own, field, what)
    for argument in ("q", "qd"):
        if what is not None:  # None is the model's own start there
            with pytest.raises(TypeError):
                batch.reset(**{argument: what})
    with pytest.raises(TypeError):
        batch.act(what)
    assert np.array_equal(batch.q, before)


def test_numbers_of_other_types_are_taken(batch):
    for numbers in (0.25, np.float16(0.25), [[0.25]], np.full((9, batch.plan.nv), 0.25, "f8"), np.zeros((9, 1), int)):
        batch.effort = numbers
        assert np.array_equal(batch.effort, np.broadcast_to(np.asarray(numbers), batch.effort.shape))


def test_a_library_without_kernels_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in ("", "libm.so.6", str(tmp_path), str(tmp_path / "pipe"), str(tmp_path / "absent.so")):
        with pytest.raises(ls.UsageError):
            ls.load_kernel(path)


def test_checkpoints_are_not_without_a_folder(tmp_path):
    from lockstep.ranks import Checkpoint, Checkpoints

    for make in (Checkpoint, lambda: Checkpoint.__new__(Checkpoint), Checkpoints,
                 lambda: Checkpoints.__new__(Checkpoints), lambda: object.__new__(Checkpoints)):
        with pytest.raises(TypeError):
            make()
    made = Checkpoints(str(tmp_path / "a"), keep=3)
    assert made.folder_of(7).parent == tmp_path / "a" and made.latest() is None


def test_ids_seeds_and_episodes_are_whole_numbers_in_their_range(batch):
    for name, wrong in (("seed", -1), ("env_id", 1 << 40), ("env_id", -1), ("episode", 1 << 31)):
        with pytest.raises(ls.UsageError, match=name):
            setattr(batch, name, wrong)
    for name in ("seed", "env_id", "episode"):
        for wrong in (1.9, "7", None, True):
            with pytest.raises(TypeError, match=name):
                setattr(batch, name, wrong)
    batch.seed, batch.env_id, batch.episode = (1 << 64) - 1, np.arange(9), -1
    assert batch.seed[3] == (1 << 64) - 1 and batch.env_id[3] == 3 and batch.episode[3] == -1
    batch.seed = [1, (1 << 63) + 1] + [3] * 7
    assert int(batch.seed[1]) == (1 << 63) + 1
    with pytest.raises(ls.SettingsError):
        batch.plan.batch(4, first_id=2**32 - 2)
    with pytest.raises(ls.SettingsError):
        batch.plan.batch(4, dtype=None)


def test_masks_are_not_taken_for_numbers(batch):
    for wrong in ([True, 1], (True, False, 2)):
        with pytest.raises(TypeError, match="not of both"):
            batch.reset(wrong)
    for wrong in ([True, False], np.array([True, False]), "shoulder_yaw"):
        with pytest.raises(TypeError, match="rows"):
            batch.randomize("mass", "scale", 2, 2, rows=wrong)
    with pytest.raises(TypeError, match="rows"):
        batch.read(ls.Query("site_position", "tip"))
    with pytest.raises(ls.UsageError, match="row -1"):
        batch.restore(batch.save(), [0], rows=[-1])


def test_heights_are_rows_of_one_length():
    model = ls.Model(links=[ls.Link("b")])
    model.colliders.append(ls.Collider("f", "", ls.Shape("height_field", (1, 1, 0), heights=((0, 0), (0,)))))
    with pytest.raises(TypeError, match="heights"):
        ls.compile(model)
