"""Splits a dataset into training, validation and test by whole source trajectories (thesis Table 7.2)."""

from __future__ import annotations

import re
from typing import Any, Literal

import numpy as np

Part = Literal["train", "validation", "test"]
_SHARES: tuple[tuple[Part, float], ...] = (("train", 0.74), ("validation", 0.12), ("test", 0.14))

_MIN_SOURCES = 3  # of one kind; also the least that can be split


def source_of(name: str) -> str:
    """`limited_07_0123` is an execution of `limited_07`; a name without such a number is its own source."""
    match = re.fullmatch(r"(.+)_\d{4}", name)
    return match[1] if match else name


def log_name(name: str) -> str:
    """The log that a recording is a piece of; a whole log is its own."""
    return re.sub(r"_p\d{3,}$", "", name)


def sources_of(names: list[str]) -> dict[str, str]:
    """Recording -> source: the coarsest grouping with enough sources to split.

    Recordings belong to their trajectory, pieces of a log to the log's trajectory. With fewer than three trajectories,
    each log is a source (a recorder that numbers its files names them like executions of one trajectory); with fewer
    than three logs, each piece is.
    """
    logs = {name: log_name(name) for name in names}
    trajectories = {name: source_of(log) for name, log in logs.items()}
    groupings = (trajectories, logs)
    pieces = {name: name for name in names}
    return next((each for each in groupings if len(set(each.values())) >= _MIN_SOURCES), pieces)


def with_split(entries: list[dict[str, Any]], seed: int) -> list[dict[str, Any]]:
    """Recordings of a manifest with source, kind and part of the split; what has a part keeps it, and its source.

    An entry has `name` and `valid_s`.
    """
    named = sources_of([entry["name"] for entry in entries])
    sources = {entry["name"]: entry.get("source", named[entry["name"]]) for entry in entries}
    seconds: dict[str, float] = {}
    for entry in entries:
        seconds[sources[entry["name"]]] = seconds.get(sources[entry["name"]], 0.0) + entry["valid_s"]
    kept: dict[str, Part] = {entry["source"]: entry["split"] for entry in entries if "split" in entry}
    parts, kinds = split(seconds, seed, kept), kinds_of(set(seconds))
    described = [(entry, sources[entry["name"]]) for entry in entries]
    return [entry | {"source": source, "kind": kinds[source], "split": parts[source]} for entry, source in described]


def kinds_of(sources: set[str]) -> dict[str, str]:
    """Source -> kind of trajectory: its name up to the last underscore; kinds of fewer than three are "other"."""
    kind = {name: name.rpartition("_")[0] or name for name in sources}
    members = list(kind.values())
    return {name: own if members.count(own) >= _MIN_SOURCES else "other" for name, own in kind.items()}


def split(sources: dict[str, float], seed: int, kept: dict[str, Part] | None = None) -> dict[str, Part]:
    """Source (name -> seconds recorded) to part, by time as near to 74/12/14 % as whole sources allow.

    Within each kind the sources are shuffled. Each part gets one source, then always the part that lacks most gets
    the next. Kinds with fewer than three sources are for training only. Sources in `kept` stay in their part.
    """
    random = np.random.default_rng(seed)
    parts: dict[str, Part] = dict(kept or {})
    kinds: dict[str, list[str]] = {}
    for name, kind in sorted(kinds_of(set(sources)).items()):
        kinds.setdefault(kind, []).append(name)
    for members in kinds.values():
        order = [members[k] for k in random.permutation(len(members)) if members[k] not in parts]
        if len(members) < _MIN_SOURCES:
            parts |= dict.fromkeys(order, "train")
            continue
        total = sum(sources[name] for name in members)
        assigned = dict.fromkeys((part for part, _ in _SHARES), 0.0)
        for name in members:
            if name in parts:
                assigned[parts[name]] += sources[name]
        first_round = iter([part for part, seconds in assigned.items() if not seconds])
        for name in order:
            lacking = max(_SHARES, key=lambda share: share[1] - assigned[share[0]] / total)[0]
            part = next(first_round, None) or lacking
            parts[name] = part
            assigned[part] += sources[name]
    return parts
