# Random numbers for each step of an environment. SPDX-License-Identifier: Apache-2.0
"""Batch.draw() gives the same numbers all through an episode. These depend on the step as well: (M143)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._lockstep import Batch, _uniform_by_step

Array = npt.NDArray[Any]
OWN = 1 << 21  # the first stream that neither observations nor events use


def uniform(batch: Batch, out: Array, stream: int = OWN) -> Array:
    """Fills out, float32 or float64 [k, num_envs], with numbers in [0, 1). They depend on an environment's seed, id,
    episode and step, on the stream and the row. Streams from draws.OWN on are for functions of one's own."""
    _uniform_by_step(batch, out, stream)
    return out


def normal(batch: Batch, out: Array, stream: int = OWN) -> Array:
    """The same, normal with mean 0 and standard deviation 1 (M99)."""
    half = len(out) // 2
    both = uniform(batch, np.empty((len(out) + len(out) % 2, out.shape[1]), np.float32), stream)
    radius = np.sqrt(-2 * np.log(both[::2] + np.float32(2.0**-24)))
    angle = np.float32(2 * np.pi) * both[1::2]
    np.multiply(radius, np.cos(angle), out=out[::2])
    np.multiply(radius[:half], np.sin(angle[:half]), out=out[1::2])
    return out
