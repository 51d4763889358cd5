# Rewards and ends of episodes as named terms. SPDX-License-Identifier: Apache-2.0
"""Rewards({name: (weight, function)}) and Terminations({name: function}) are functions of an environment that return
{name: [num_envs]}. A function or method of one's own may return such a dict as well."""

from __future__ import annotations

from typing import Any, Callable, Mapping

import numpy as np
import numpy.typing as npt

from .errors import UsageError

Array = npt.NDArray[Any]
TOTAL = "has the name of the sum of all terms"


def _named(terms: Any, what: str) -> dict[str, Any]:
    if not isinstance(terms, Mapping) or not terms:
        raise UsageError(f"{what} terms", f"are {terms!r}", "give {name: term}", "usage")
    for name in terms:
        if not isinstance(name, str) or not name:
            raise UsageError(f"{what} term {name!r}", "has no name", "give a text", "usage")
    return dict(terms)


def each(given: Any, num_envs: int, dtype: Any, name: str) -> Array:
    """[num_envs]; raises UsageError for another shape or type."""
    values = np.asarray(given)
    if values.shape != (num_envs,):
        raise UsageError(name, f"gives the shape {values.shape}", f"return ({num_envs},)", "usage")
    if values.dtype.kind not in ("b" if dtype == np.bool_ else "fiub"):
        raise UsageError(name, f"gives the type {values.dtype}", f"return {np.dtype(dtype)}", "usage")
    return values.astype(dtype, copy=False)


def refuse_taken(name: str) -> None:
    """A rule of this name would hide a reason that every environment has."""
    if name in ("fault", "time_out"):
        raise UsageError(f"termination '{name}'", "has the name of a reason that every environment has",
                         "give it another name", "usage")


class Rewards:
    """terms: {name: (weight, function of the environment that returns [num_envs])}. Weights are for a control step.
    A call returns {name: weight * value}, float32."""

    def __init__(self, terms: Mapping[str, tuple[float, Callable[[Any], Any]]]) -> None:
        self.terms = _named(terms, "reward")
        for name, term in self.terms.items():
            if name == "total":
                raise UsageError("reward term 'total'", TOTAL, "give it another name", "usage")
            if not (isinstance(term, tuple) and len(term) == 2 and callable(term[1])):
                raise UsageError(f"reward term '{name}'", f"is {term!r}", "give (weight, function)", "usage")
            if not np.isfinite(term[0]):
                raise UsageError(f"reward term '{name}'", f"has the weight {term[0]}", "give a finite one", "usage")

    def __call__(self, env: Any) -> dict[str, Array]:
        return {
            name: np.float32(weight) * each(function(env), env.num_envs, np.float32, f"reward term '{name}'")
            for name, (weight, function) in self.terms.items()
        }


class Terminations:
    """terms: {name: function of the environment that returns [num_envs] bool}. Where several hold, the first is the
    reason."""

    def __init__(self, terms: Mapping[str, Callable[[Any], Any]]) -> None:
        self.terms = _named(terms, "termination")
        for name, function in self.terms.items():
            refuse_taken(name)
            if not callable(function):
                raise UsageError(f"termination '{name}'", f"is {function!r}", "give a function", "usage")

    def __call__(self, env: Any) -> dict[str, Array]:
        return {
            name: each(function(env), env.num_envs, np.bool_, f"termination '{name}'")
            for name, function in self.terms.items()
        }


class EpisodeLog:
    """Sums of reward terms over episodes; means over those that ended."""

    def __init__(self, num_envs: int) -> None:
        self.num_envs = num_envs
        self.sums: dict[str, Array] = {}

    def add(self, terms: Mapping[str, Array], paid: Array) -> Array:
        """The total, where `paid`. Raises UsageError that names a term which is not finite."""
        if "total" in terms:
            raise UsageError("reward term 'total'", TOTAL, "give it another name", "usage")
        total = np.zeros(self.num_envs, np.float32)
        for values in terms.values():
            total += values
        if not np.isfinite(total[paid]).all():
            for name, values in terms.items():
                for place in np.flatnonzero(paid & ~np.isfinite(values)):
                    raise UsageError(f"reward term '{name}'", f"is {values[place]} in environment {place}",
                                     "return finite numbers", "usage")
        if not paid.all():
            total = np.where(paid, total, np.float32(0))
        for name, values in (*terms.items(), ("total", total)):
            sums = self.sums.setdefault(name, np.zeros(self.num_envs, np.float64))
            np.add(sums, values, out=sums, where=paid)
        return total

    def ended(self, which: Array, elapsed: Array, reasons: Mapping[str, Array]) -> dict[str, float]:
        """Means over the episodes that end; their sums begin again."""
        log = {f"reward/{name}": float(sums[which].mean()) for name, sums in self.sums.items()}
        log["episode/length"] = float(elapsed[which].mean())
        for name, holds in reasons.items():
            log[f"end/{name}"] = float(holds[which].mean())
        return log

    def restart(self, which: Array) -> None:
        for sums in self.sums.values():
            sums[which] = 0
