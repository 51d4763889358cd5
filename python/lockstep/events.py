# What happens to environments: at the start, at resets, at intervals. SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Mapping, Optional

import numpy as np
import numpy.typing as npt

from .draws import uniform
from .errors import UsageError

Array = npt.NDArray[Any]
MOMENTS = ("start", "randomize", "reset", "interval")
FIRST_STREAM = 1 << 20  # observations have the streams below


@dataclass(frozen=True)
class Event:
    """function(env, which) is called with the mask of the environments that it happens to.

    on: "start" before episode 0, "randomize" before the state of each episode is drawn, "reset" after it, or "interval".
    every: (shortest, longest) time in s from a reset or the last event to the next, of on="interval". The times of an
    environment depend on its seed, id and episode.
    """

    function: Callable[[Any, Array], None]
    on: str = "reset"
    every: Optional[tuple[float, float]] = None


class Events:
    """Events by name. `env` has a batch; step_time: s in a control step."""

    def __init__(self, events: Mapping[str, Event], num_envs: int, step_time: float) -> None:
        self.events = dict(events)
        self.step_time = step_time
        self.left: dict[str, Array] = {}  # control steps until the next
        for name, event in self.events.items():
            if not isinstance(event, Event) or not callable(event.function):
                raise UsageError(f"event '{name}'", f"is {event!r}", "give Event(function, ...)", "usage")
            if event.on not in MOMENTS:
                raise UsageError(f"event '{name}'", f"is on {event.on!r}", f"give one of {', '.join(MOMENTS)}", "usage")
            if (event.on == "interval") != (event.every is not None):
                raise UsageError(f"event '{name}'", f"is on '{event.on}' with every={event.every}",
                                 "give every=(shortest, longest) with on='interval' alone", "usage")
            if event.every is not None:
                if len(event.every) != 2 or not 0 < event.every[0] <= event.every[1] < np.inf:
                    raise UsageError(f"event '{name}'", f"is every {event.every}",
                                     "give (shortest, longest) in s, above 0", "usage")
                self.left[name] = np.zeros(num_envs, np.int64)

    def happen(self, moment: str, env: Any, which: Array) -> None:
        for event in self.events.values():
            if event.on == moment and which.any():
                event.function(env, which)

    def restart(self, env: Any, which: Array) -> None:
        """Episodes begin in these environments."""
        for name in self.left:
            self._schedule(name, env, which)

    def step(self, env: Any, which: Array) -> None:
        """A control step has passed in these environments."""
        for name, left in self.left.items():
            left -= which
            now = which & (left <= 0)
            if now.any():
                self.events[name].function(env, now)
                self._schedule(name, env, now)

    def _schedule(self, name: str, env: Any, which: Array) -> None:
        shortest, longest = self.events[name].every or (0.0, 0.0)
        share = uniform(env.batch, np.empty((1, len(which))), FIRST_STREAM + list(self.events).index(name))[0]
        steps = np.rint((shortest + (longest - shortest) * share) / self.step_time).clip(1, 1 << 62).astype(np.int64)
        self.left[name][which] = steps[which]
