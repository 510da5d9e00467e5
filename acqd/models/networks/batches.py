"""Mini-batches as in the thesis: sequences sorted by length, each batch truncated to its shortest (Figure 7.14)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.models.networks.flat_parameters import Singles


@dataclass(frozen=True, slots=True)
class Example:
    """One sequence, normalised."""

    inputs: Singles
    """[T + 2 radius, axes] angles for frames, else features [T, width]."""
    target: Singles
    """[T]."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Sequences of one length."""

    inputs: Singles
    """[B, T or T + 2 radius, width]."""
    target: Singles
    """[B, T]."""


def batches(examples: list[Example], size: int, margin: int) -> list[Batch]:
    """All examples in batches of `size`; `margin` is how many rows inputs are longer than targets."""
    order = sorted(examples, key=lambda example: len(example.target))
    made = []
    for first in range(0, len(order), size):
        chosen = order[first : first + size]
        rows = len(chosen[0].target)
        inputs = np.stack([example.inputs[: rows + margin] for example in chosen])
        made.append(Batch(inputs, np.stack([example.target[:rows] for example in chosen])))
    return made
