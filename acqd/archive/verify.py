"""Whether a segment is what was written: every checksum, every sample."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.archive.segment import Segment
from acqd.errors import InputError


@dataclass(frozen=True, slots=True)
class Checked:
    """One file."""

    file: str
    samples: int
    """Read without a fault."""
    faults: list[str]


def verified(segment: Segment) -> Checked:
    """Read a segment as a whole."""
    faults, samples = [], 0
    if segment.damaged:
        faults.append(f"{segment.damaged} bytes among its records are none")
    try:
        segment.state()
        for block in segment.blocks():
            samples += len(block.codes)
    except InputError as error:
        faults.append(str(error).removeprefix(f"{segment.path}: "))
    except OSError as error:
        faults.append(f"cannot be read ({error.strerror})")
    if not faults and samples != segment.samples:
        faults.append(f"has {samples} samples, and its index says {segment.samples}")
    return Checked(str(segment.path), samples, faults)
