"""Training, validation and test: whole source trajectories, so that none is on two sides (thesis Table 7.2)."""

from __future__ import annotations

import re
from typing import Literal

import numpy as np

Part = Literal["train", "validation", "test"]
_SHARES: tuple[tuple[Part, float], ...] = (("train", 0.74), ("validation", 0.12), ("test", 0.14))

_LEAST_SOURCES = 3  # that make a kind


def source_of(name: str) -> str:
    """`limited_07_0123` is an execution of `limited_07`; a name without such a number is its own source."""
    match = re.fullmatch(r"(.+)_\d{4}", name)
    return match[1] if match else name


def sources_of(names: list[str]) -> dict[str, str]:
    """Recording -> source. Pieces of a log belong to its source, unless there would be too few to split by."""
    whole = {name: source_of(re.sub(r"_p\d{3}$", "", name)) for name in names}
    return whole if len(set(whole.values())) >= _LEAST_SOURCES else {name: source_of(name) for name in names}


def kinds_of(sources: set[str]) -> dict[str, str]:
    """Source -> kind of trajectory: its name up to the last underscore; kinds with fewer than three are "other"."""
    kind = {name: name.rpartition("_")[0] or name for name in sources}
    members = list(kind.values())
    return {name: own if members.count(own) >= _LEAST_SOURCES else "other" for name, own in kind.items()}


def split(sources: dict[str, float], seed: int) -> dict[str, Part]:
    """Source (name -> seconds recorded) to part, by time as near to 74/12/14 % as whole sources allow.

    Sources are dealt out within each kind, in random order: one to each part, then always to the part that lacks
    most. With fewer than three sources all train.
    """
    random = np.random.default_rng(seed)
    parts: dict[str, Part] = {}
    kinds: dict[str, list[str]] = {}
    for name, kind in sorted(kinds_of(set(sources)).items()):
        kinds.setdefault(kind, []).append(name)
    for members in kinds.values():
        order = [members[k] for k in random.permutation(len(members))]
        if len(order) < _LEAST_SOURCES:
            parts |= dict.fromkeys(order, "train")
            continue
        total = sum(sources[name] for name in order)
        given = dict.fromkeys((part for part, _ in _SHARES), 0.0)
        firsts = iter(given)
        for name in order:
            part = next(firsts, None) or max(_SHARES, key=lambda share: share[1] - given[share[0]] / total)[0]
            parts[name] = part
            given[part] += sources[name]
    return parts
