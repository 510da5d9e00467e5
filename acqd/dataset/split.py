"""Training, validation and test: whole source trajectories, so that none is on two sides (thesis Table 7.2)."""

from __future__ import annotations

import re
from typing import Literal

import numpy as np

Part = Literal["train", "validation", "test"]
_SHARES: tuple[tuple[Part, float], ...] = (("train", 0.74), ("validation", 0.12), ("test", 0.14))


def source_of(name: str) -> str:
    """`limited_07_0123` is an execution of `limited_07`; a name without such a number is its own source."""
    match = re.fullmatch(r"(.+)_\d{4}", name)
    return match[1] if match else name


def split(sources: dict[str, float], seed: int) -> dict[str, Part]:
    """Source (name -> seconds recorded) to part, by time as near to 74/12/14 % as whole sources allow.

    Sources are dealt out within each kind (the name up to its last underscore), longest first in random order
    of equals, always to the part that lacks most. With fewer than three sources of a kind all train.
    """
    random = np.random.default_rng(seed)
    parts: dict[str, Part] = {}
    kinds: dict[str, list[str]] = {}
    for name in sorted(sources):
        kinds.setdefault(name.rpartition("_")[0] or name, []).append(name)
    for members in kinds.values():
        order = [members[k] for k in random.permutation(len(members))]
        total = sum(sources[name] for name in order)
        given = dict.fromkeys((part for part, _ in _SHARES), 0.0)
        for name in order:
            part = max(_SHARES, key=lambda share: share[1] - given[share[0]] / total)[0] if len(order) > 2 else "train"
            parts[name] = part
            given[part] += sources[name]
    return parts
