"""A threshold: a value with unit, stage, source and meaning."""

from __future__ import annotations

from dataclasses import field
from typing import Any, Literal, get_args

Stage = Literal["recordings", "delay", "noise", "detectors", "selection", "uncertainty", "verdict", "joints", "monitor"]
"""Of the method; one module each."""
STAGES: tuple[Stage, ...] = get_args(Stage)


def threshold(value: float, unit: str, stage: Stage, source: str, meaning: str) -> Any:
    """A field of a dataclass; `source` is convention, choice, study or physics."""
    metadata = {"unit": unit, "stage": stage, "source": source, "meaning": meaning}
    return field(default=value, metadata=metadata)
