# Observations in named groups of terms. SPDX-License-Identifier: Apache-2.0
"""Observations({"policy": {...}, "critic": {...}}) is a function of an environment: it returns {group: [num_envs, k]}.
It works with a VectorEnv as with anything else that has a `batch`."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from .draws import normal, uniform
from .errors import UsageError
from .query import Query

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Uniform:
    """Noise between low and high, in the unit of the term."""

    low: float
    high: float


@dataclass(frozen=True)
class Normal:
    """Noise with this standard deviation, in the unit of the term."""

    deviation: float


@dataclass(frozen=True)
class Term:
    """Columns of a group: (what + noise), clipped, times scale.

    what: a query (a name or a Query), a function of the environment that returns [num_envs] or [num_envs, k], or
    constant numbers. clip: (low, high), in the unit of `what`. Where all terms of a group have a clip, the bounds of
    its space are finite.
    """

    what: Any
    scale: float = 1.0
    clip: Optional[tuple[float, float]] = None
    noise: Union[None, Uniform, Normal] = None


@dataclass(frozen=True)
class Group:
    """Terms by name, side by side. history: how many frames are stacked, the oldest first. A frame is kept whenever an
    environment has stepped; all frames are the first one when an episode begins."""

    terms: Mapping[str, Any]
    history: int = 1


class _Columns:
    """A group that knows its columns, with its memory."""

    def __init__(self, name: str, group: Group, env: Any, first_stream: int) -> None:
        self.name, self.history = name, group.history
        self.terms: list[tuple[str, Term, slice, int]] = []
        width = 0
        for stream, (key, given) in enumerate(group.terms.items(), first_stream):
            term = given if isinstance(given, Term) else Term(given)
            columns = _values(term, env, f"{name}.{key}").shape[1]
            self.terms.append((key, term, slice(width, width + columns), stream))
            width += columns
        num_envs = env.batch.num_envs
        self.frames = np.zeros((group.history, width, num_envs), np.float32)
        self.out = np.zeros((num_envs, group.history * width), np.float32)
        self.noise = np.zeros((width, num_envs), np.float32)

    def bounds(self) -> tuple[Array, Array]:
        low = np.full(self.frames.shape[1], -np.inf, np.float32)
        high = -low
        for _, term, columns, _ in self.terms:
            if term.clip is not None:
                ends = np.array(term.clip, np.float32)  # rounded as see() rounds
                ends *= term.scale
                low[columns], high[columns] = ends.min(), ends.max()
        return np.tile(low, self.history), np.tile(high, self.history)

    def see(self, env: Any, read: Mapping[Any, Array], moved: Array, began: Array) -> Array:
        if self.history > 1:
            for older, newer in zip(self.frames[:-1], self.frames[1:]):
                np.copyto(older, newer, where=moved)
        frame = self.frames[-1]
        for key, term, columns, stream in self.terms:
            rows = frame[columns]
            seen = read.get(_key(term.what))
            rows[...] = (_values(term, env, f"{self.name}.{key}", len(rows)) if seen is None else seen).T
            if term.noise is not None:
                noise = self.noise[columns]
                if isinstance(term.noise, Uniform):
                    uniform(env.batch, noise, stream)
                    noise *= term.noise.high - term.noise.low
                    noise += term.noise.low
                else:
                    normal(env.batch, noise, stream)
                    noise *= term.noise.deviation
                rows += noise
            if term.clip is not None:
                np.clip(rows, *term.clip, out=rows)
            if term.scale != 1.0:
                rows *= term.scale
        if self.history > 1 and began.any():
            self.frames[:-1, :, began] = frame[:, began]
        width = len(frame)
        for place, kept in enumerate(self.frames):
            self.out[:, place * width : (place + 1) * width] = kept.T
        return self.out


def _is_query(what: Any) -> bool:
    return isinstance(what, (str, Query))


def _key(what: Any) -> Any:
    if isinstance(what, Query):
        points = None if what.points is None else tuple(map(tuple, what.points))
        return (what.quantity, None if what.rows is None else tuple(what.rows), what.scale, points)
    return what if isinstance(what, str) else None


def _values(term: Term, env: Any, name: str, columns: Optional[int] = None) -> Array:
    """[num_envs, k]"""
    num_envs = env.batch.num_envs
    if _is_query(term.what):
        return np.asarray(env.batch.read(term.what))
    if callable(term.what):
        values = np.asarray(term.what(env))
        if values.ndim == 1:
            values = values[:, None]
        wanted = f"({num_envs}, {'k' if columns is None else columns})"
        if values.ndim != 2 or len(values) != num_envs or (columns is not None and values.shape[1] != columns):
            raise UsageError(f"observation term '{name}'", f"has the shape {values.shape}", f"return {wanted}",
                             "usage.query")
    else:
        values = np.broadcast_to(np.atleast_1d(np.asarray(term.what)), (num_envs, np.size(term.what)))
    if values.dtype.kind not in "fiub":
        raise UsageError(f"observation term '{name}'", f"has the type {values.dtype}", "give numbers", "usage.query")
    return values


def _checked(name: Any, given: Any) -> Group:
    group = given if isinstance(given, Group) else Group(given)
    terms = group.terms
    if not isinstance(terms, Mapping):
        if isinstance(terms, str) or not isinstance(terms, Sequence) or not all(_is_query(t) for t in terms):
            raise UsageError(f"observation group '{name}'", "has terms without names", "give {name: term}", "usage.query")
        terms = {str(place): term for place, term in enumerate(terms)}
    for what, label in [(name, "group")] + [(key, "term") for key in terms]:
        if not isinstance(what, str) or not what:
            raise UsageError(f"observation {label} {what!r}", "is no name", "give a text", "usage.query")
    if not terms:
        raise UsageError(f"observation group '{name}'", "has no terms", "give one at least", "usage.query")
    if isinstance(group.history, bool) or not isinstance(group.history, int) or group.history < 1:
        raise UsageError(f"observation group '{name}'", f"has the history {group.history!r}", "give 1 or more",
                         "usage.query")
    for key, term in terms.items():
        _check_term(f"{name}.{key}", term if isinstance(term, Term) else Term(term))
    return Group(dict(terms), group.history)


def _check_term(name: str, term: Term) -> None:
    def fail(rule: str, remedy: str) -> None:
        raise UsageError(f"observation term '{name}'", rule, remedy, "usage.query")

    if not np.isfinite(term.scale):
        fail(f"has the scale {term.scale}", "give a finite number")
    if term.clip is not None and not (len(term.clip) == 2 and term.clip[0] <= term.clip[1]):
        fail(f"has the clip {term.clip}", "give (low, high) with low at most high")
    if isinstance(term.noise, Uniform):
        if not -np.inf < term.noise.low <= term.noise.high < np.inf:
            fail(f"has noise from {term.noise.low} to {term.noise.high}", "give finite numbers, low at most high")
    elif isinstance(term.noise, Normal):
        if not 0 <= term.noise.deviation < np.inf:
            fail(f"has noise of the deviation {term.noise.deviation}", "give a finite number, 0 or more")
    elif term.noise is not None:
        fail(f"has the noise {term.noise!r}", "give Uniform(low, high) or Normal(deviation)")


class Observations:
    """groups: {name: group}, a group being a Group, {name: term} or queries; a term is a Term or what a Term takes.

    A call reads all queries of all groups in one pass and returns {group: float32 [num_envs, k]}; the next call writes
    to the same arrays. Noise depends on seed, id, episode and step of an environment, so a second call without a step
    sees the same. They belong to the environment that calls them first: each needs its own, since they keep its history.
    Raises UsageError that names group and term.
    """

    def __init__(self, groups: Mapping[str, Any]) -> None:
        if not isinstance(groups, Mapping) or not groups:
            raise UsageError("observation groups", f"are {groups!r}", "give {name: group}", "usage.query")
        self.groups = {name: _checked(name, group) for name, group in groups.items()}
        self._columns: list[_Columns] = []
        self._batch: Any = None  # a weak reference

    def _prepare(self, env: Any) -> None:
        batch, self._columns = env.batch, []
        stream = 0
        for name, group in self.groups.items():
            self._columns.append(_Columns(name, group, env, stream))
            stream += len(group.terms)
        queries: dict[Any, Any] = {}
        for seen in self._columns:
            for _, term, _, _ in seen.terms:
                if _is_query(term.what):
                    queries.setdefault(_key(term.what), term.what)
        self._queries = list(queries.values())
        self._widths = [batch.read(query).shape[1] for query in self._queries]
        self._rows = np.zeros((sum(self._widths), batch.num_envs), batch.dtype)
        self._divide()
        self._steps = np.full(batch.num_envs, -1, np.int64)
        self._episodes = np.full(batch.num_envs, np.iinfo(np.int64).min, np.int64)
        self._seeds = batch.seed.copy()

    def _divide(self) -> None:
        ends = np.cumsum([0] + self._widths)
        self._read = {_key(query): self._rows[a:b].T for query, a, b in zip(self._queries, ends, ends[1:])}

    def __call__(self, env: Any) -> dict[str, Array]:
        batch = env.batch
        owner = self._batch and self._batch()
        if owner is not None and owner is not batch:
            raise UsageError("observations", "belong to another environment, whose history they keep",
                             "make Observations for each", "usage.query")
        if self._batch and owner is None or not self._columns:  # the first environment, or one after another
            self._prepare(env)
        self._batch = weakref.ref(batch)
        if self._queries:
            batch.read(*self._queries, out=self._rows.T)
        began = (batch.episode != self._episodes) | (batch.steps < self._steps) | (batch.seed != self._seeds)
        moved = began | (batch.steps != self._steps)
        self._steps[...], self._episodes[...], self._seeds[...] = batch.steps, batch.episode, batch.seed
        return {group.name: group.see(env, self._read, moved, began) for group in self._columns}

    def bounds(self) -> dict[str, tuple[Array, Array]]:
        """(low, high) of the columns of each group, after the first call."""
        return {group.name: group.bounds() for group in self._columns}

    def columns(self) -> dict[str, dict[str, slice]]:
        """Where the terms of each group are in a frame, after the first call."""
        return {group.name: {key: columns for key, _, columns, _ in group.terms} for group in self._columns}

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        state.pop("_read", None)
        state["_batch"] = None  # a copy is of the copied environment
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self._columns:
            self._divide()
