# What stands for Gymnasium's types where it is not installed. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import enum
from typing import Any

import numpy as np


class AutoresetMode(enum.Enum):
    NEXT_STEP = "NextStep"
    SAME_STEP = "SameStep"
    DISABLED = "Disabled"


class Box:
    """Arrays of one shape, between low and high."""

    def __init__(self, low: float, high: float, shape: tuple[int, ...], dtype: Any = np.float32) -> None:
        self.shape = tuple(shape)
        self.dtype = np.dtype(dtype)
        self.low = np.full(self.shape, low, self.dtype)
        self.high = np.full(self.shape, high, self.dtype)
        self._random = np.random.default_rng()

    def seed(self, seed: int) -> list[int]:
        self._random = np.random.default_rng(seed)
        return [seed]

    def sample(self) -> Any:
        """Uniform where bounded, normal where not."""
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        low, high = np.where(bounded, self.low, 0.0), np.where(bounded, self.high, 1.0)
        numbers = np.where(bounded, self._random.uniform(low, high), self._random.normal(size=self.shape))
        return numbers.astype(self.dtype)

    def contains(self, x: Any) -> bool:
        x = np.asarray(x)
        fits = x.shape == self.shape and np.can_cast(x.dtype, self.dtype)
        return bool(fits and np.all(x >= self.low) and np.all(x <= self.high))

    def __contains__(self, x: Any) -> bool:
        return self.contains(x)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Box)
            and self.shape == other.shape
            and self.dtype == other.dtype
            and bool(np.all(self.low == other.low) and np.all(self.high == other.high))
        )

    def __repr__(self) -> str:
        return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"
