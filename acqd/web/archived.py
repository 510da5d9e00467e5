"""One second of the past, out of the archive of the daemon, as the scope shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import OperationError, UserError
from acqd.sources.waveform import Waveform
from acqd.timestamps import filetime, rfc3339
from acqd.web.scope import ScopeError, analysed

_SECOND_NS = 1_000_000_000
_POINTS = 1_000
"""Pieces of the second, each shown by its smallest and its largest sample: nothing hides between them."""
_ANALYSED_S = 0.2
"""Of the middle, for RMS and harmonics: ten cycles."""
_LEAST_S = 0.04


def second(place: Path | None, device: str, at_s: float) -> dict[str, Any]:
    """Traces and figures of the second from `at_s` [Unix s] on. Raises ScopeError where there are no samples."""
    if place is None:
        raise ScopeError("no archive: [archive] is not enabled, and the page cannot look back")
    from acqd.archive.catalogue import contents  # with libsndfile, for whoever looks back
    from acqd.archive.export import stretches

    begin = round(at_s * 1e9)
    try:
        there = contents(place, device, begin, begin + _SECOND_NS)
        found = list(stretches(there, begin, begin + _SECOND_NS))
    except (UserError, OperationError) as error:
        raise ScopeError(f"no samples: {error}") from None
    except OSError as error:
        raise ScopeError(f"no samples: {place}: {error.strerror}") from None
    if not found:
        raise ScopeError(f"the archive has no samples of {device} at {rfc3339(begin, 0)[:19]}Z")
    return _picture(device, max(found, key=lambda each: len(each.codes)), len(found) > 1)


def _picture(device: str, waveform: Waveform, broken: bool) -> dict[str, Any]:
    form, count, start = waveform.form, len(waveform.codes), waveform.start_utc_ns or 0
    if count < _LEAST_S * form.rate:
        raise ScopeError("the archive has less than two cycles of this second")
    part = max(0, (count - round(_ANALYSED_S * form.rate)) // 2)
    names = [form.channel_name(k) for k in range(2 * form.phases)]
    figures = analysed(
        {
            "device": device, "seq": None, "time": rfc3339(start), "filetime": filetime(start),
            "flags": sorted(waveform.flags), "rate": form.rate, "channels": names, "scale": list(form.scale),
            "codes": waveform.codes[part : count - part].T,
        }
    )  # fmt: skip
    pieces = np.array_split(np.arange(count), min(_POINTS, count // 2))
    values = waveform.codes * np.array(form.scale)
    edges = np.array([[piece[0], piece[-1]] for piece in pieces]).ravel()
    traces = {name: _envelope(values[:, k], pieces) for k, name in enumerate(names)}
    return figures | {
        "archived": True,
        "broken": broken,
        "ms": np.round(edges * 1e3 / form.rate, 3).tolist(),
        "traces": traces,
    }


def _envelope(x: Floats, pieces: list[np.ndarray]) -> list[float]:
    """Smallest and largest sample of each piece, in the order in which they are."""
    shown: list[float] = []
    for piece in pieces:
        part = x[piece]
        low, high = int(part.argmin()), int(part.argmax())
        shown += [float(f"{part[k]:.4g}") for k in sorted((low, high))]
    return shown
