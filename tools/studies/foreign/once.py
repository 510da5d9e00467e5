"""Stages of the loop, computed once for the same arguments and the same values of the thresholds that they read.

Reading, columns, noise model, searches in the residual, shapes and intervals take most of a run. Arguments are
compared by their values, so that a stage runs again wherever a moved threshold has changed what goes into the stage;
what a stage reads of the thresholds is noted while the stage runs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy import averaging, loop, search
from acqd.discrepancy.ability.ability import Ability
from acqd.discrepancy.recordings import Subject, subject_of
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Column, Regression
from acqd.discrepancy.regression.scenes import Scenes
from acqd.discrepancy.regression.setup import Comparison, Setup, set_up
from acqd.discrepancy.repair import guard, terms, usual_error
from acqd.discrepancy.repair.predictive import Beside, Predictive
from acqd.discrepancy.selection import confidence, forward_selection, placing, spread, step
from acqd.discrepancy.selection.accepted import Selected, Selection
from acqd.discrepancy.strength import Strength
from acqd.discrepancy.thresholds import THRESHOLDS, Thresholds
from acqd.models.segments import Segment

_LARGE = 100_000
"""Values of an array that is compared by identity: the columns of a design, which all runs of a case share."""


@dataclass(frozen=True, slots=True)
class _Result:
    """What a stage has returned, and the thresholds that it has read, with their values."""

    returned: Any
    read: dict[str, Any]

    @property
    def valid(self) -> bool:
        """Whether these thresholds have the same values still."""
        return all(getattr(THRESHOLDS, name) == value for name, value in self.read.items())


class Once:
    """Results of the stages of one case."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, bytes], _Result] = {}
        self._reading: list[dict[str, Any]] = []
        """Thresholds that the running stages have read, the innermost stage last."""
        self._alive: list[Any] = []
        """What was compared by identity: another object must not get the same one."""
        self._fed: dict[int, bytes] = {}
        """Digests of records that are a part of many arguments, by identity."""

    def stage(self, function: Callable[..., Any], key: Callable[..., Any]) -> Callable[..., Any]:
        """The function, computed once for every value of `key` of its arguments and of the thresholds that it reads."""
        name = f"{function.__module__}.{function.__qualname__}"

        def known(*arguments: Any, **named: Any) -> Any:
            at = name, self._digest(key(*arguments, **named))
            result = self._known.get(at)
            if result is None or not result.valid:
                result = self._known[at] = self._computed(lambda: function(*arguments, **named))
            for outer in self._reading:
                outer |= result.read
            returned = result.returned
            return list(returned) if isinstance(returned, list) else returned  # who asked may add to the list

        return known

    def _computed(self, stage: Callable[[], Any]) -> _Result:
        read: dict[str, Any] = {}
        self._reading.append(read)
        try:
            return _Result(stage(), read)
        finally:
            self._reading.pop()

    def watched(self) -> AbstractContextManager[object]:
        """Note what running stages read of the thresholds."""
        names, plain = {field.name for field in fields(Thresholds)}, object.__getattribute__

        def read(of: Thresholds, name: str) -> Any:
            value = plain(of, name)
            if self._reading and name in names and of is THRESHOLDS:
                self._reading[-1][name] = value
            return value

        return mock.patch.object(Thresholds, "__getattribute__", read)

    def set_up(self, function: Callable[..., Setup]) -> Callable[..., Setup]:
        """The setup of a comparison, with the scenes as they were at first: a run ends with fewer."""
        kept: dict[int, frozenset[int]] = {}
        once = self.stage(function, lambda comparison, _: comparison)

        def known(comparison: Comparison, progress: Callable[[float], None]) -> Setup:
            setup: Setup = once(comparison, progress)
            scenes = setup.design.columns.scenes
            scenes.kept = kept.setdefault(id(scenes), scenes.kept)
            return setup

        return known

    def _digest(self, value: Any) -> bytes:
        digest = hashlib.blake2b(digest_size=16)
        self._feed(digest.update, value)
        return digest.digest()

    def _feed(self, update: Callable[[bytes], None], value: Any) -> None:
        """Values of records, arrays and numbers; everything else by identity."""
        update(type(value).__name__.encode())
        if isinstance(value, np.ndarray) and value.size < _LARGE:
            update(f"{value.dtype} {value.shape}".encode())
            update(value.tobytes())
        elif value is None or isinstance(value, str | int | float | np.generic | Path):
            update(repr(value).encode())
        elif isinstance(value, Column | Candidate | Segment):
            if id(value) not in self._fed:
                self._alive.append(value)
                self._fed[id(value)] = self._digest([getattr(value, field.name) for field in fields(value)])
            update(self._fed[id(value)])
        else:
            parts = self._parts(value)
            update(str(len(parts)).encode())
            for each in parts:
                self._feed(update, each)

    def _parts(self, value: Any) -> Sequence[Any]:
        """What decides whether two values are the same."""
        if isinstance(value, list | tuple):
            return value
        if isinstance(value, set | frozenset):
            return sorted(value)
        if isinstance(value, dict):
            return list(value.items())
        if isinstance(value, Regression):
            return value.columns
        if isinstance(value, Design):
            return value.columns.scenes, value.whitener, value.trusted, value.added, value.witness
        if is_dataclass(value):
            return [getattr(value, field.name) for field in fields(value)]
        self._alive.append(value)
        return id(value), sorted(value.kept) if isinstance(value, Scenes) else None


@contextmanager
def once() -> Iterator[None]:
    """Compute the stages once from here on, for one dataset and model; without the parts that only a report shows."""
    stages = Once()

    def state(of: step.State) -> Any:
        return of.rows.design, of.rows.regression, of.gates, [each.id for each in of.effects]

    def without_hypothesis(selection: Selection, selected: Selected) -> Any:
        return selection.rows, selected.finding, selected.gate, selected.place, selected.shape

    def what_is_beside(selection: Selection, subject: Subject) -> Any:
        return selection.rows, [without_hypothesis(selection, each) for each in selection.effects], subject.held_out

    def density(predictive: Predictive, errors: list[Floats], effects: Collection[tuple[str, str]]) -> Any:
        return predictive, errors, sorted(effects)

    def all_of(*arguments: Any) -> Any:
        return arguments

    with stages.watched(), ExitStack() as patches:

        def replaced(module: Any, name: str, function: Callable[..., Any]) -> None:
            patches.enter_context(mock.patch.object(module, name, function))

        replaced(loop, "subject_of", stages.stage(subject_of, lambda config, _: config))
        replaced(search, "set_up", stages.set_up(set_up))
        replaced(Beside, "of", stages.stage(Beside.of, what_is_beside))
        for where, name, key in (
            (step, "_with_detections", state),
            (step, "ranked", all_of),
            (confidence, "ranked", all_of),
            (forward_selection, "ranked", all_of),
            (forward_selection, "with_loaded_laws", all_of),
            (placing, "fit_shape", all_of),
            (spread, "_amplitudes", all_of),
            (terms, "intervals", without_hypothesis),
            (averaging, "predictions", all_of),
            (averaging, "_fits", all_of),
            (loop, "errors_of", all_of),
            (usual_error, "errors_of", all_of),
            (guard, "errors_of", all_of),
            (Design, "with_trusted", all_of),
            (Predictive, "density", density),
        ):
            replaced(where, name, stages.stage(getattr(where, name), key))
        for shown in (Ability, Strength):
            replaced(shown, "of", lambda *_: None)
        yield
