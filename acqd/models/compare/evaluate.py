"""Every model on every kind of held-out recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import orjson

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.bundle.bundle import is_bundle
from acqd.models.bundle.restore import open_model
from acqd.models.compare.baselines import constant, linear_physics, noise_floor
from acqd.models.compare.stability import unstable_share
from acqd.models.metrics import Metrics, measure, predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Dataset, Segment

_RESAMPLES = 500
_AVERAGED = ("mae", "rmse", "bias", "r2", "energy_p95")
_Member: TypeAlias = tuple[dict[str, Any], Predictor | None, list[Floats]]
"""bundle.json, the model and its predictions."""


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """One model, or several seeds of one."""

    name: str
    trained_on: str
    """Kinds of trajectories."""
    seeds: int
    metrics: dict[str, Metrics]
    """By test set: "everything" and each kind."""
    mae_ci95: tuple[float, float]
    """W, on everything: over source trajectories, and seeds where there are several."""
    unstable: float
    """Share of seconds in which it oscillates by itself."""
    errors: Floats
    """[rows] |error| on everything, of the first seed."""
    predicted: list[Floats]
    """Of the first seed, for the test stretches."""
    model: Predictor | None
    """Of the first seed; None for baselines."""
    metadata: dict[str, Any]
    """bundle.json of the first seed."""

    @property
    def label(self) -> str:
        """For axes of pictures."""
        return self.name


@dataclass(frozen=True, slots=True)
class Comparison:
    """All of it."""

    data: Dataset
    test: list[Segment]
    entries: list[Entry]
    baselines: list[Entry]
    floor_W: float | None
    notes: list[str]

    @property
    def kinds(self) -> list[str]:
        """Columns of the heatmaps."""
        return [*self.data.kinds, "everything"] if len(self.data.kinds) > 1 else ["everything"]

    def best(self) -> Entry:
        """Lowest MAE on everything."""
        return min(self.entries, key=lambda entry: entry.metrics["everything"].mae)

    def find(self, name: str, trained_on: str) -> Entry | None:
        """By name and training data."""
        return next((e for e in self.entries if (e.name, e.trained_on) == (name, trained_on)), None)


def compare(data: Dataset, models: Path, progress: Callable[[str, float], None]) -> Comparison:
    """Bundles found under `models` on the test recordings of `data`. Raises UserError."""
    paths = sorted(path for path in _bundles(models))
    if not paths:
        raise UserError(f"{models}: no bundles there; acqd train makes them")
    test, training = data.part("test"), data.part("train")
    notes: list[str] = []
    groups: dict[tuple[str, str, str], dict[int, _Member]] = {}
    for number, path in enumerate(paths):
        bundle, model = open_model(path)
        metadata = bundle.metadata
        if metadata["robot"] != data.robot or metadata["axes"] != data.axes or metadata["step_s"] != data.step_s:
            notes.append(f"{path.name}: left out, it is of {metadata['robot']} at {metadata['step_s']} s")
            continue
        fitted = metadata["provenance"]["fit_recordings"] + metadata["provenance"]["validation_recordings"]
        seen = set(fitted) & {segment.recording for segment in test}
        if seen:
            notes.append(f"{path.name}: left out, it has seen {len(seen)} of the test recordings")
            continue
        if metadata["provenance"]["manifest_sha256"] != data.digest:
            notes.append(f"{path.name}: trained on another dataset")
        trained_on = "+".join(metadata["training"]["kinds"])
        everything = "+".join(data.kinds)
        settings = orjson.dumps(metadata.get("settings"), option=orjson.OPT_SORT_KEYS).decode()
        key = (metadata["name"], "everything" if trained_on == everything else trained_on, settings)
        members = groups.setdefault(key, {})
        if metadata["training"]["seed"] in members:
            notes.append(f"{path.name}: left out, the same seed was trained twice")
            continue
        members[metadata["training"]["seed"]] = (metadata, model, predictions(model, test))
        progress(path.name, (number + 1) / len(paths))
    if not groups:
        raise UserError(f"{models}: no bundle fits this dataset; {notes[0]}")
    entries = []
    for name, kinds, settings in groups:
        alike = [other for other in groups if other[:2] == (name, kinds)]
        label = name if len(alike) == 1 else f"{name} ({_difference(settings, [other[2] for other in alike])})"
        entries.append(_entry(label, kinds, list(groups[name, kinds, settings].values()), data, test))
    guesses = {"constant": constant(training, test), "linear physics": linear_physics(training, test, data.step_s)}
    baselines = [_entry(name, "everything", [({}, None, guess)], data, test) for name, guess in guesses.items()]
    return Comparison(data, test, entries, baselines, noise_floor(data), notes)


def _difference(settings: str, others: list[str]) -> str:
    """What sets a training apart from others of the same network: epochs 200, say."""
    own, rest = orjson.loads(settings) or {}, [orjson.loads(other) or {} for other in others]
    differing = [key for key in own if any(other.get(key) != own[key] for other in rest)]
    return ", ".join(f"{key} {own[key]}" for key in differing) or "other settings"


def _bundles(models: Path) -> Iterator[Path]:
    if is_bundle(models):
        yield models
        return
    if models.is_dir():
        yield from (path for path in models.iterdir() if not path.name.startswith(".") and is_bundle(path))


def _entry(
    name: str,
    trained_on: str,
    members: list[_Member],
    data: Dataset,
    test: list[Segment],
) -> Entry:
    metrics = {"everything": _mean([measure(guess, test) for _, _, guess in members])}
    for kind in data.kinds if len(data.kinds) > 1 else []:
        own = [k for k, segment in enumerate(test) if segment.kind == kind]
        if own:
            chosen = [test[k] for k in own]
            metrics[kind] = _mean([measure([guess[k] for k in own], chosen) for _, _, guess in members])
    metadata, model, first = members[0]
    errors = np.concatenate([np.abs(guess - s.P) for guess, s in zip(first, test, strict=True)])
    unstable = float(np.mean([unstable_share(guess, test) for _, _, guess in members]))
    interval = _interval([guess for _, _, guess in members], test)
    return Entry(name, trained_on, len(members), metrics, interval, unstable, errors, first, model, metadata)


def _mean(each: list[Metrics]) -> Metrics:
    mae, rmse, bias, r2, energy = (float(np.mean([getattr(one, name) for one in each])) for name in _AVERAGED)
    return replace(each[0], mae=mae, rmse=rmse, bias=bias, r2=r2, energy_p95=energy)


def _interval(guesses: list[list[Floats]], test: list[Segment]) -> tuple[float, float]:
    """95 % bootstrap of the MAE over source trajectories (executions of one are alike) and seeds."""
    random = np.random.default_rng(0)
    sources = sorted({segment.source for segment in test})
    place = {name: k for k, name in enumerate(sources)}
    sums, rows = np.zeros((len(guesses), len(sources))), np.zeros(len(sources))
    for k, segment in enumerate(test):
        rows[place[segment.source]] += len(segment.P)
        for seed, guess in enumerate(guesses):
            sums[seed, place[segment.source]] += np.abs(guess[k] - segment.P).sum()
    drawn = []
    for _ in range(_RESAMPLES):
        which = random.integers(len(sources), size=len(sources))
        seeds = random.integers(len(guesses), size=len(guesses))
        drawn.append(sums[seeds][:, which].sum() / (len(guesses) * rows[which].sum()))
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(low), float(high)
