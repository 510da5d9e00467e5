"""Mini-batches of sequences sorted by length, each batch truncated to its shortest sequence (thesis Figure 7.14)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.models.networks.flat_parameters import Float32s


@dataclass(frozen=True, slots=True)
class Example:
    """One normalised sequence."""

    inputs: Float32s
    """Angles [T + 2 radius, axes] for convolution kernels, else features [T, width]."""
    target: Float32s
    """[T]."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Sequences of one length."""

    inputs: Float32s
    """[B, T or T + 2 radius, width]."""
    target: Float32s
    """[B, T]."""


def batches(examples: list[Example], size: int, margin: int) -> list[Batch]:
    """All examples in batches of `size`; inputs have `margin` more rows than targets."""
    by_length = sorted(examples, key=lambda example: len(example.target))
    result = []
    for first in range(0, len(by_length), size):
        chosen = by_length[first : first + size]
        rows = len(chosen[0].target)
        inputs = np.stack([example.inputs[: rows + margin] for example in chosen])
        result.append(Batch(inputs, np.stack([example.target[:rows] for example in chosen])))
    return result
