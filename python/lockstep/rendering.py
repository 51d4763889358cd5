# Pictures of a batch. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import base64
import json
import zlib
from typing import Any, Sequence

import numpy as np
import numpy.typing as npt

from ._lockstep import Batch, _Motion
from .chromium import Chromium
from .errors import UsageError
from .model import VisualMesh
from .recording import checked

LARGEST = 4096  # pixels along a side, which all WebGL has


class Renderer:
    """Pictures of some environments of a batch as they are at present: those of the page of `lockstep view`, drawn by a
    Chromium that runs headless until close() or the end of a `with`.

        with lockstep.rendering.Renderer(batch, [0, 3]) as renderer:
            first, second = renderer.frames()

    size: width and height in pixels, 16 to 4096. visual_meshes: as in a Recording. The view is set by where the
    environments are when this is made. It follows where all roots float. Chromium is the file that the environment variable CHROME names, else chromium,
    chromium-browser or google-chrome on the PATH. Raises UsageError without one, without the viewer in this build, and
    for environments that the batch does not have. It is not thread-safe, as the batch is not."""

    def __init__(self, batch: Batch, environments: Sequence[int] = (0,), size: tuple[int, int] = (640, 480),
                 visual_meshes: Sequence[VisualMesh] = ()) -> None:
        self._batch = batch
        self._environments = checked(batch, environments)
        self._width, self._height = size
        if not all(16 <= side <= LARGEST for side in size):
            raise UsageError("size", f"is {size}", f"give a width and a height of 16 to {LARGEST} pixels", "usage")
        self._motion = _Motion.of(batch.plan, self._environments, visual_meshes)
        page = self._present().page("").decode()
        self._chromium = Chromium()
        self._chromium.run(f"document.open(), document.write({json.dumps(page)}), document.close()")
        self._chromium.run(f"pictures = lockstep.pictures({self._width}, {self._height}), 0")

    def frames(self) -> tuple[npt.NDArray[np.uint8], ...]:
        """uint8 [height, width, 3] of each of the environments, red, green, blue, from the left upper corner."""
        taken = self._chromium.run(f"pictures.take('{self._present().numbers()}')")
        pixels = np.frombuffer(zlib.decompress(base64.b64decode(taken)), np.uint8)
        pictures = pixels.reshape(len(self._environments), self._height, self._width, 4)
        return tuple(np.ascontiguousarray(picture[::-1, :, :3]) for picture in pictures)

    def close(self) -> None:
        """Ends Chromium."""
        self._chromium.close()

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()

    def _present(self) -> _Motion:
        self._motion.clear()
        self._motion.add(0.0, self._batch, self._environments)
        return self._motion
