"""Reference recordings in a bundle: rows on which the residual of the new model can be computed again later.

`acqd close-loop` fits the same effects to these rows and to new recordings. What the model lacks on both cancels,
so that only what has changed since the training counts.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.models.bundle.bundle import REFERENCE, REFERENCE_HASH, Arrays, load_metadata
from acqd.models.segments import Segment

_AROUND = 12  # rows before and after a segment, as datasets have them
_MAX_ROWS = 60_000  # 40 minutes: a few MB
_SIGNALS = ("brake", "tool")


def reference_arrays(segments: list[Segment]) -> Arrays:
    """Up to 40 minutes of whole segments as arrays: held-out ones first, taking the sources in turn."""
    by_turn = sorted(range(len(segments)), key=lambda k: (segments[k].split == "train", _turn(segments, k)))
    chosen: list[Segment] = []
    rows = 0
    for k in by_turn:
        if rows + len(segments[k].P) <= _MAX_ROWS or not chosen:
            chosen.append(segments[k])
            rows += len(segments[k].P)
    arrays: Arrays = {
        "rows": np.array([len(s.P) for s in chosen]),
        "start_s": np.array([s.start_s for s in chosen]),
        "names": np.frombuffer("\n".join(f"{s.recording}\t{s.source}\t{s.split}" for s in chosen).encode(), np.uint8),
        "q": np.concatenate([s.q for s in chosen]).astype(np.float32),
        "P": np.concatenate([s.P for s in chosen]).astype(np.float32),
        "lag_within_s": np.array([s.lag_within_s for s in chosen]),
        "worked_s": np.array([s.worked_s for s in chosen]),
    }
    for name in _SIGNALS:
        if all(name in s.signals for s in chosen):
            arrays[f"signal.{name}"] = np.concatenate([s.signals[name] for s in chosen]).astype(np.float32)
    for name in ("Vrms", "current", "temperature"):
        if all(name in s.channels for s in chosen):
            arrays[f"channel.{name}"] = np.concatenate([s.channels[name] for s in chosen]).astype(np.float32)
    if any(s.before is not None or s.after is not None for s in chosen):
        arrays["around"] = np.array([_around(s) for s in chosen], dtype=np.float32)
    if all(s.tau is not None for s in chosen):
        arrays["tau"] = np.concatenate([s.tau for s in chosen if s.tau is not None]).astype(np.float32)
    return arrays


def _around(segment: Segment) -> Floats:
    """[2, _AROUND, axes] rad: angles before and after a segment, NaN where unknown."""
    values = np.full((2, _AROUND, segment.q.shape[1]), np.nan)
    if segment.before is not None:
        before = segment.before[-_AROUND:]
        values[0, _AROUND - len(before) :] = before
    if segment.after is not None:
        after = segment.after[:_AROUND]
        values[1, : len(after)] = after
    return values


def _turn(segments: list[Segment], k: int) -> int:
    """Number of earlier segments of the same source."""
    return sum(1 for other in segments[:k] if other.source == segments[k].source)


def load_reference(bundle: Path) -> list[Segment]:
    """The reference recordings of a bundle; empty for a bundle written without any.

    Raises InputError for a bundle that has lost its file, or has that of another one.
    """
    path, written = bundle / REFERENCE, load_metadata(bundle).get(REFERENCE_HASH)
    if not path.exists():
        if written is None:
            return []
        raise InputError(path, "is missing: changes are found against its recordings; copy the whole bundle again")
    try:
        content = path.read_bytes()
        if written not in (None, hashlib.sha256(content).hexdigest()):
            raise InputError(path, "does not match the hash in bundle.json; copy the whole bundle again")
        return _segments(load(content))
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise InputError(path, f"cannot be read ({error}); copy the bundle again") from None


def _segments(arrays: Arrays) -> list[Segment]:
    names = arrays["names"].tobytes().decode().split("\n")
    ends = np.cumsum(arrays["rows"])
    segments = []
    for k, (name, end) in enumerate(zip(names, ends, strict=True)):
        recording, source, split = name.split("\t")
        rows = slice(int(end - arrays["rows"][k]), int(end))

        def part(values: Floats, rows: slice = rows) -> Floats:
            return np.asarray(values[rows], dtype=np.float64)

        segments.append(
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
                *_known_around(arrays, k),
                lag_within_s=float(arrays["lag_within_s"][k]) if "lag_within_s" in arrays else 0.0,
                worked_s=float(arrays["worked_s"][k]) if "worked_s" in arrays else 0.0,
            )
        )
    return segments


def _known_around(arrays: Arrays, k: int) -> tuple[Floats | None, Floats | None]:
    """Angles before and after segment `k`; None in bundles without them."""
    if "around" not in arrays:
        return None, None
    before, after = (np.asarray(side, dtype=np.float64) for side in arrays["around"][k])
    return before[np.isfinite(before).all(axis=1)], after[np.isfinite(after).all(axis=1)]
