# Python and C step to the same bits. SPDX-License-Identifier: Apache-2.0
import ctypes
import pathlib

import numpy as np
from conftest import MODELS

import lockstep as ls

GEAR_RATIO, MASS = 0, 5  # of lockstep/c.h


class Settings(ctypes.Structure):
    _fields_ = [("size", ctypes.c_uint32), ("per_environment", ctypes.c_uint32), ("rest", ctypes.c_char * 256)]


class Options(ctypes.Structure):
    _fields_ = [("size", ctypes.c_uint32), ("first_id", ctypes.c_uint32), ("seed", ctypes.c_uint64),
                ("environments", ctypes.c_int64), ("threads", ctypes.c_int32), ("precision", ctypes.c_int32)]


class Randomization(ctypes.Structure):
    _fields_ = [("size", ctypes.c_uint32), ("parameter", ctypes.c_int32), ("operation", ctypes.c_int32),
                ("distribution", ctypes.c_int32), ("low", ctypes.c_double), ("high", ctypes.c_double),
                ("stream", ctypes.c_uint32), ("shared", ctypes.c_int32)]


class Array(ctypes.Structure):
    _fields_ = [("size", ctypes.c_uint32), ("flags", ctypes.c_uint32), ("data", ctypes.c_void_p),
                ("type", ctypes.c_int32), ("rank", ctypes.c_int32), ("shape", ctypes.c_int64 * 2),
                ("stride", ctypes.c_int64 * 2)]


def by_c(count, first_id, actions):
    library = ctypes.CDLL(str(next(pathlib.Path(ls.__file__).parents[1].glob("liblockstep.so"))))
    library.lockstep_message.restype = ctypes.c_char_p

    def call(name, *arguments):
        assert getattr(library, name)(*arguments) == 0, library.lockstep_message()

    model, plan, batch = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_void_p()
    call("lockstep_model_from_urdf", str(MODELS / "gripper.urdf").encode(), ctypes.byref(model))
    call("lockstep_model_set_drive", model, b"knuckle", ctypes.c_double(8.0), ctypes.c_double(0.3))
    settings = Settings()
    library.lockstep_settings_init(ctypes.byref(settings))
    settings.per_environment = 1 << GEAR_RATIO | 1 << MASS
    call("lockstep_compile", model, ctypes.byref(settings), ctypes.byref(plan))
    options = Options()
    library.lockstep_options_init(ctypes.byref(options))
    options.environments, options.first_id, options.seed = count, first_id, 11
    call("lockstep_batch_new", plan, ctypes.byref(options), ctypes.byref(batch))
    how = Randomization()
    library.lockstep_randomization_init(ctypes.byref(how))
    how.parameter, how.low, how.high = GEAR_RATIO, 0.9, 1.1
    call("lockstep_randomize", batch, ctypes.byref(how), None, ctypes.c_int64(0))
    call("lockstep_reset_random", batch, None, ctypes.c_int64(0), ctypes.c_double(0.5), ctypes.c_double(0.2))
    positions, given = Array(), Array(size=ctypes.sizeof(Array), rank=2)
    call("lockstep_field", batch, 0, ctypes.byref(positions))
    seen = []
    for action in actions:
        given.data = action.ctypes.data
        given.shape[:], given.stride[:] = (1, count), (4, 4)
        call("lockstep_act", batch, ctypes.byref(given))
        call("lockstep_step", batch, 4)
        rows, columns = positions.shape
        memory = (ctypes.c_float * (rows * positions.stride[0] // 4)).from_address(positions.data)
        seen.append(np.ctypeslib.as_array(memory).reshape(rows, -1)[:, :columns].T.copy())
    for kind, thing in (("batch", batch), ("plan", plan), ("model", model)):
        getattr(library, f"lockstep_{kind}_free")(thing)
    return np.array(seen)


def test_python_and_c_see_the_same_bits():
    model = ls.from_urdf(MODELS / "gripper.urdf")
    model.joints["knuckle"].drive = ls.Drive(kp=8.0, kd=0.3)
    batch = ls.compile(model, vary=["gear_ratio", "mass"]).batch(9, seed=11)
    batch.randomize("gear_ratio", "scale", 0.9, 1.1)
    batch.reset_random(spread=0.5, speed=0.2)
    actions = np.random.default_rng(3).uniform(-1, 1, (50, 9)).astype(np.float32)
    seen = []
    for action in actions:
        batch.act(action[:, None])
        batch.step(4)
        seen.append(batch.q.copy())
    assert np.array_equal(np.array(seen), by_c(9, 0, actions))
    assert np.array_equal(np.array(seen)[:, 4:7], by_c(3, 4, np.ascontiguousarray(actions[:, 4:7])))
