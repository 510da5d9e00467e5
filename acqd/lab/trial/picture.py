"""The true power of a hidden change beside what the loop has added to the model, in a recording that no fit saw."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.models.segments import Segment, load_dataset
from acqd.report.lines import Chart, Line, Panel

_SHOWN_S = 30.0


@dataclass(frozen=True, slots=True)
class Sessions:
    """True powers of a campaign: times [T] (Unix, s) of the windows, and the power [T] that effects add, W."""

    times: list[Floats]
    added: list[Floats]

    @classmethod
    def of(cls, truth: Path) -> Sessions:
        """From the truth folder of a campaign."""
        times: list[Floats] = []
        added: list[Floats] = []
        for file in sorted(truth.glob("*.npz")):
            with np.load(file) as arrays:
                power = arrays["P_W"] - arrays["P_without_effects_W"]
                start_s = float(arrays["start_utc_ns"]) * 1e-9
                times.append(start_s + float(arrays["window_s"]) * np.arange(len(power), dtype=np.float64))
                added.append(power.astype(np.float64))
        return cls(times, added)

    def at(self, times: Floats) -> Floats:
        """Power [N] that effects added at some times, W; 0 outside of all sessions."""
        total = np.zeros(len(times))
        for t, P in zip(self.times, self.added, strict=True):
            total += np.interp(times, t, P, left=0.0, right=0.0)
        return total


def picture(dataset: Path, before: Path, after: Path, truth: Path) -> Chart:
    """At most half a minute of a held-out recording in which the hidden change takes most power.

    `before`, `after`: bundles of the model that the loop was given, and of the model that it has returned.
    """
    data, sessions = load_dataset(dataset), Sessions.of(truth)
    (_, old), (bundle, new) = open_model(before), open_model(after)
    used = set(bundle.metadata["provenance"].get("closed_fit_recordings", ()))
    segments = [each for each in data.segments if each.recording not in used] or data.segments
    width = max(2, round(_SHOWN_S / data.step_s))
    _, segment, rows = max(_pieces(segments, sessions, data.step_s, width), key=lambda piece: piece[0])
    predicted, repaired = (predictions(model, [segment])[0][rows] for model in (old, new))
    t = data.step_s * np.arange(rows.start, rows.stop, dtype=np.float64)
    true = sessions.at(segment.start_s + t)
    lines = [Line("measured", segment.P[rows]), Line("model before", predicted, "before")]
    change = [Line("hidden change, true", true)]
    if not np.array_equal(predicted, repaired):
        lines.append(Line("model after", repaired, "after"))
        change.append(Line("explained by the loop", repaired - predicted, "after"))
    rms_W = float(np.sqrt((true**2).mean()))
    alt = f"Power of {segment.recording}, measured and predicted. The hidden change takes {rms_W:.1f} W RMS."
    return Chart(
        t, f"time in {segment.recording} [s]", [Panel("P [W]", lines), Panel("change [W]", change, 150, zero=True)], alt
    )


def _pieces(
    segments: list[Segment], sessions: Sessions, step_s: float, width: int
) -> Iterator[tuple[float, Segment, slice]]:
    """Of every segment the piece of at most `width` rows with the largest mean square of the true power."""
    for segment in segments:
        true = sessions.at(segment.start_s + step_s * np.arange(len(segment.P), dtype=np.float64))
        rows = min(width, len(true))
        squares = np.convolve(true**2, np.full(rows, 1 / rows), "valid")
        first = int(squares.argmax())
        yield float(squares[first]), segment, slice(first, first + rows)
