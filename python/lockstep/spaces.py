# What stands for Gymnasium's types where it is not installed. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import enum
from typing import Any, Optional

import numpy as np


class AutoresetMode(enum.Enum):
    NEXT_STEP = "NextStep"
    SAME_STEP = "SameStep"
    DISABLED = "Disabled"


class Box:
    """Arrays of one shape, between low and high."""

    def __init__(self, low: Any, high: Any, shape: tuple[int, ...], dtype: Any = np.float32) -> None:
        self.shape = tuple(shape)
        self.dtype = np.dtype(dtype)
        self.low = np.full(self.shape, low, self.dtype)
        self.high = np.full(self.shape, high, self.dtype)
        self._random = np.random.default_rng()

    def seed(self, seed: Optional[int] = None) -> Optional[int]:
        self._random = np.random.default_rng(seed)
        return seed

    def sample(self) -> Any:
        """Uniform where bounded, exponential beyond one bound, normal where there is none."""
        below, above = np.isfinite(self.low), np.isfinite(self.high)
        low, high = np.where(below, self.low, 0.0), np.where(above, self.high, 0.0)
        beyond = self._random.exponential(size=self.shape)
        numbers = np.where(below, low + beyond, np.where(above, high - beyond, self._random.normal(size=self.shape)))
        both = below & above
        uniform = self._random.uniform(np.where(both, low, 0.0), np.where(both, high, 1.0))
        return np.where(both, uniform, numbers).astype(self.dtype)

    def contains(self, x: Any) -> bool:
        x = np.asarray(x)
        fits = x.shape == self.shape and np.can_cast(x.dtype, self.dtype, "same_kind")
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
        low, high = (bound.flat[0] if bound.size else "-" for bound in (self.low, self.high))
        return f"Box({low}, {high}, {self.shape}, {self.dtype})"


class Dict:
    """Spaces by name."""

    def __init__(self, spaces: dict[str, Box]) -> None:
        self.spaces = dict(spaces)

    def __getitem__(self, name: str) -> Box:
        return self.spaces[name]

    def __iter__(self) -> Any:
        return iter(self.spaces)

    def __len__(self) -> int:
        return len(self.spaces)

    def keys(self) -> Any:
        return self.spaces.keys()

    def items(self) -> Any:
        return self.spaces.items()

    def sample(self) -> dict[str, Any]:
        return {name: space.sample() for name, space in self.spaces.items()}

    def contains(self, x: Any) -> bool:
        return isinstance(x, dict) and x.keys() == self.spaces.keys() and all(
            space.contains(x[name]) for name, space in self.spaces.items())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Dict) and self.spaces == other.spaces

    def __repr__(self) -> str:
        return f"Dict({self.spaces})"
