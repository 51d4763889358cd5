# Frames of a batch, as a page that plays them. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import operator
import os
import pathlib
from typing import Sequence, Union

from ._lockstep import Batch, _Motion
from .errors import UsageError
from .model import VisualMesh


def checked(batch: Batch, environments: Sequence[int]) -> list[int]:
    """The environments, which must be some of the batch, each once."""
    chosen = [operator.index(environment) for environment in environments]
    if not chosen or len(set(chosen)) < len(chosen) or not all(0 <= one < batch.num_envs for one in chosen):
        raise UsageError("environments", f"are {chosen}", f"give different ones from 0 to {batch.num_envs - 1}",
                         "usage.environment")
    return chosen


class Recording:
    """Frames of some environments of a batch, for the page that `lockstep view` writes, too.

        recording = lockstep.Recording(batch, [0, 3])
        for control in range(300):
            batch.step(4)
            recording.add()
        recording.save("page.html")

    The first frame is taken when it is made. A frame holds poses, forces of contacts, joint positions, coupling errors
    and energies as they are then, whatever was written to the batch. visual_meshes: what links are drawn as, such as
    those of from_file(visual_meshes=True). Raises UsageError for environments that the batch does not have. It is not
    thread-safe, as the batch is not."""

    def __init__(self, batch: Batch, environments: Sequence[int] = (0,), visual_meshes: Sequence[VisualMesh] = ()) -> None:
        self._batch = batch
        self._environments = checked(batch, environments)
        self._motion = _Motion.of(batch.plan, self._environments, visual_meshes)
        self._time = 0.0  # s
        self._interval = 1  # steps of dt between the latest two frames
        self._take()

    def add(self) -> None:
        """Takes a frame. The time since the one before is that of the steps that these environments took; where none
        tells, because all were reset or are frozen, it is as long as between the frames before. Raises UsageError where
        the page would be too large for a browser, and takes none then."""
        self.require_room()
        stayed = self._batch.episode[self._environments] == self._episode
        taken = (self._batch.steps[self._environments] - self._steps)[stayed]
        self._interval = int(taken.max(initial=0)) or self._interval
        self._time += self._interval * self._batch.plan.dt
        self._take()

    def require_room(self) -> None:
        """Raises the UsageError of add() where a further frame would be too much."""
        self._motion.require_room(self._motion.samples + 1)

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the page: one HTML file that needs no server and no network. Frames may be added later, too. Raises
        UsageError where the package was built without the viewer, and OSError."""
        plan = self._batch.plan
        page = self._motion.page(f"{plan.method}, {plan.integrator}, step {plan.dt:.4g} s, {self._batch.dtype}")
        pathlib.Path(path).write_bytes(page)

    def __len__(self) -> int:
        return self._motion.samples

    def _take(self) -> None:
        self._motion.add(self._time, self._batch, self._environments)
        self._steps = self._batch.steps[self._environments]
        self._episode = self._batch.episode[self._environments]
