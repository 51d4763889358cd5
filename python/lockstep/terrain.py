# Height fields for learning: patches of ground, and rows of them that get harder. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Sequence

import numpy as np
import numpy.typing as npt

from .model import Shape

Heights = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Patch:
    """A square of ground to fill: heights[rows, columns] in m, rows along y. Its middle is the origin.

    edge: m. cell: m, what two heights are apart. flat: m, the edge of a level square in the middle, to start on.
    Methods return heights; a difficulty between 0 and 1 makes a patch of what a number says at 1."""

    edge: float = 8.0
    cell: float = 0.1
    flat: float = 1.0

    def __post_init__(self) -> None:
        cells = self.edge / self.cell
        if not (cells >= 2 and abs(cells - 2 * round(cells / 2)) < 1e-6 * cells):
            raise ValueError(f"an edge of {self.edge} m is {cells:g} cells; make it an even whole number of them")

    @property
    def count(self) -> int:
        """Heights along an edge."""
        return round(self.edge / self.cell) + 1

    def level(self) -> Heights:
        """All at 0."""
        return np.zeros((self.count, self.count))

    def slope(self, gradient: float) -> Heights:
        """A pyramid without a top: falls to all sides by `gradient`, rises where that is below 0."""
        return -gradient * self._from_flat()

    def stairs(self, rise: float, tread: float) -> Heights:
        """Steps of `rise`, m, down to all sides, up where that is below 0, each `tread`, m, wide: at least two cells, as a
        step is a cell wide itself."""
        if tread < 2 * self.cell:
            raise ValueError(f"a tread of {tread} m is less than two cells of {self.cell} m; make cells smaller")
        return -rise * np.ceil(self._from_flat() / tread - 1e-9)

    def waves(self, height: float, length: float) -> Heights:
        """`height`, m, from crest to trough, and `length`, m, from crest to crest, along x and y."""
        if not length > 0:
            raise ValueError(f"waves of {length} m are none; give a length above 0")
        x, y = self._places()
        return self._levelled(0.25 * height * (np.cos(2 * np.pi * x / length) + np.cos(2 * np.pi * y / length)))

    def rough(self, height: float, random: np.random.Generator) -> Heights:
        """Each height by itself between -height / 2 and height / 2, m."""
        return self._levelled(random.uniform(-0.5 * height, 0.5 * height, (self.count, self.count)))

    def gaps(self, width: float, every: float, depth: float = 1.0) -> Heights:
        """Square ditches around the middle, `depth` deep and `width` wide at the bottom, one in `every`, m. Their walls are
        a cell wide."""
        if not 0 <= width < every:
            raise ValueError(f"gaps are {width} m wide, one in {every} m; give 0 <= width < every")
        if width == 0:
            return self.level()
        beyond = self._from_flat()
        return np.where((beyond > 1e-9) & ((beyond - self.cell + 1e-9) % every < width + 2e-9), -depth, 0.0)

    def _places(self) -> tuple[Heights, Heights]:
        along = np.linspace(-0.5 * self.edge, 0.5 * self.edge, self.count)
        x, y = np.meshgrid(along, along)
        return x, y

    def _from_flat(self) -> Heights:
        x, y = self._places()
        return np.maximum(np.maximum(np.abs(x), np.abs(y)) - 0.5 * self.flat, 0.0)

    def _levelled(self, heights: Heights) -> Heights:
        return np.where(self._from_flat() > 0, heights, 0.0)


@dataclass(frozen=True)
class Terrain:
    """Patches side by side as one height field: levels along x, kinds along y.

    heights: m. patch: what each was made in. origins[level, kind]: x, y, z of the middle of a patch, m, in the frame of
    the field."""

    heights: Heights
    patch: Patch
    origins: npt.NDArray[np.float64]

    def shape(self) -> Shape:
        """Its collider's. Put it into the world, without a pose."""
        rows, columns = self.heights.shape
        return Shape.height_field(self.heights, (columns - 1) * self.patch.cell, (rows - 1) * self.patch.cell)

    def place(self, level: npt.ArrayLike, kind: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """[num_envs, 4] The collider's columns of batch.parameter("collider_place"): x, y, z and yaw that bring the middle
        of a patch below the origin of each environment. A move between levels is a write of these."""
        at = self.origins[np.asarray(level), np.asarray(kind)]
        return np.concatenate([-at, np.zeros((*at.shape[:-1], 1))], axis=-1)


def curriculum(patch: Patch, levels: int, kinds: Sequence[Callable[[float], Heights]]) -> Terrain:
    """A patch for each level and kind. Each kind makes heights of a difficulty, from 0 at the first level to 1 at the
    last. Patches share their borders, where the later one's heights count."""
    cells = patch.count - 1
    heights = np.zeros((len(kinds) * cells + 1, levels * cells + 1))
    origins = np.zeros((levels, len(kinds), 3))
    middle = 0.5 * np.array([levels, len(kinds)]) * patch.edge
    for level in range(levels):
        for kind, make in enumerate(kinds):
            made = make(level / max(1, levels - 1))
            if made.shape != (patch.count, patch.count):
                raise ValueError(f"kind {kind} makes {made.shape} heights; make them by the patch of the curriculum")
            heights[kind * cells : (kind + 1) * cells + 1, level * cells : (level + 1) * cells + 1] = made
            x, y = (np.array([level, kind]) + 0.5) * patch.edge - middle
            origins[level, kind] = x, y, made[patch.count // 2, patch.count // 2]
    return Terrain(heights, patch, origins)
