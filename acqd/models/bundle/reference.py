"""The recordings that a bundle remembers: what the model's residual was when it was made.

Whoever asks later what has changed compares with these rows, not with a number: the same physics is fitted to
both, and what both lack cancels.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.models.bundle.bundle import REFERENCE, Arrays
from acqd.models.segments import Segment

_MOST_ROWS = 60_000  # 40 minutes: a few MB
_SIGNALS = ("brake", "tool")


def reference_arrays(segments: list[Segment]) -> Arrays:
    """Whole recordings as arrays, held-out ones first, up to 40 minutes; every source has its turn."""
    order = sorted(range(len(segments)), key=lambda k: (segments[k].split == "train", _turn(segments, k)))
    chosen: list[Segment] = []
    rows = 0
    for k in order:
        if rows + len(segments[k].P) <= _MOST_ROWS or not chosen:
            chosen.append(segments[k])
            rows += len(segments[k].P)
    found: Arrays = {
        "rows": np.array([len(each.P) for each in chosen]),
        "start_s": np.array([each.start_s for each in chosen]),
        "names": np.frombuffer("\n".join(f"{s.recording}\t{s.source}\t{s.split}" for s in chosen).encode(), np.uint8),
        "q": np.concatenate([each.q for each in chosen]).astype(np.float32),
        "P": np.concatenate([each.P for each in chosen]).astype(np.float32),
    }
    for name in _SIGNALS:
        if all(name in each.signals for each in chosen):
            found[f"signal.{name}"] = np.concatenate([each.signals[name] for each in chosen]).astype(np.float32)
    for name in ("Vrms", "current", "temperature"):
        if all(name in each.channels for each in chosen):
            found[f"channel.{name}"] = np.concatenate([each.channels[name] for each in chosen]).astype(np.float32)
    if all(each.tau is not None for each in chosen):
        found["tau"] = np.concatenate([each.tau for each in chosen if each.tau is not None]).astype(np.float32)
    return found


def _turn(segments: list[Segment], k: int) -> int:
    """How many earlier recordings are of the same source."""
    return sum(1 for other in segments[:k] if other.source == segments[k].source)


def load_reference(bundle: Path) -> list[Segment]:
    """What the bundle remembers; nothing for one that does not. Raises InputError."""
    path = bundle / REFERENCE
    if not path.exists():
        return []
    try:
        arrays = load_file(path)
        return _segments(arrays)
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise InputError(path, f"cannot be read ({error}); copy the bundle again") from None


def _segments(arrays: Arrays) -> list[Segment]:
    names = arrays["names"].tobytes().decode().split("\n")
    ends = np.cumsum(arrays["rows"])
    found = []
    for k, (name, end) in enumerate(zip(names, ends, strict=True)):
        recording, source, split = name.split("\t")
        rows = slice(int(end - arrays["rows"][k]), int(end))

        def part(values: Floats, rows: slice = rows) -> Floats:
            return np.asarray(values[rows], dtype=np.float64)

        found.append(
            Segment(
                recording,
                source,
                "other",
                split,  # type: ignore[arg-type]
                part(arrays["q"]),
                part(arrays["P"]),
                part(arrays["tau"]) if "tau" in arrays else None,
                {key.removeprefix("signal."): part(a) for key, a in arrays.items() if key.startswith("signal.")},
                float(arrays["start_s"][k]),
                {key.removeprefix("channel."): part(a) for key, a in arrays.items() if key.startswith("channel.")},
            )
        )
    return found
