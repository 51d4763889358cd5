# Random numbers for each step of an environment. SPDX-License-Identifier: Apache-2.0
"""Batch.draw() gives the same numbers all through an episode. These depend on the step as well: (M143)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def _mixed(x: Array) -> Array:
    """The last step of SplitMix64, in place."""
    with np.errstate(over="ignore"):
        x ^= x >> np.uint64(30)
        x *= np.uint64(0xBF58476D1CE4E5B9)
        x ^= x >> np.uint64(27)
        x *= np.uint64(0x94D049BB133111EB)
        x ^= x >> np.uint64(31)
    return x


def _words(batch: Any, columns: int, stream: int) -> Array:
    """[columns, num_envs] of 64 bits"""
    with np.errstate(over="ignore"):
        x = _mixed(batch.seed + GOLDEN)
        for part in (batch.env_id, batch.episode, batch.steps, np.uint64(stream)):
            x = _mixed(x + GOLDEN + np.asarray(part).astype(np.uint64))
        return _mixed(x + GOLDEN * np.arange(1, columns + 1, dtype=np.uint64)[:, None])


def uniform(batch: Any, out: Array, stream: int = 0) -> Array:
    """Fills out, float [k, num_envs], with numbers in [0, 1). They depend on an environment's seed, id, episode and
    step, on the stream and the row."""
    half = (len(out) + 1) // 2
    words = _words(batch, half, stream)
    np.multiply(words[: len(out) - half] >> np.uint64(40), 2.0**-24, out=out[half:], casting="unsafe")
    np.multiply((words[:half] >> np.uint64(8)) & np.uint64(0xFFFFFF), 2.0**-24, out=out[:half], casting="unsafe")
    return out


def normal(batch: Any, out: Array, stream: int = 0) -> Array:
    """The same, normal with mean 0 and standard deviation 1 (M99)."""
    half = (len(out) + 1) // 2
    both = uniform(batch, np.empty((2 * half, out.shape[1]), np.float32), stream)
    radius = np.sqrt(-2 * np.log(both[:half] + np.float32(2.0**-24)))
    angle = np.float32(2 * np.pi) * both[half:]
    np.multiply(radius, np.cos(angle), out=out[:half])
    np.multiply(radius[: len(out) - half], np.sin(angle[: len(out) - half]), out=out[half:])
    return out
