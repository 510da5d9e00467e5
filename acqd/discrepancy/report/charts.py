"""Charts of the closing report: power before and after, autocorrelation, how likely the causes are."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.repair.terms import Reported
from acqd.models.effects import library
from acqd.report.bars import Bar, Bars, ranked
from acqd.report.digits import percent
from acqd.report.lines import Chart, Colour, Line, Panel
from acqd.residual.whitening import autocorrelation

_SHOWN_S = 60.0
LEAST_CONFIDENCE = 0.005
"""Alternatives with less are not drawn."""
_LAGS = 50


def example(closed: Closed) -> tuple[Chart, str]:
    """At most a minute: where the loop helped most, or where the residual is largest, and its recording."""
    step_s = closed.subject.data.step_s
    size = [
        b**2 - a**2 if closed.extended else b**2 for b, a in zip(closed.errors_before, closed.errors_after, strict=True)
    ]
    k = int(np.argmax([float(each.mean()) for each in size]))
    segment = closed.subject.held_out[k]
    width = min(len(segment.P), int(_SHOWN_S / step_s))
    first = int(np.convolve(size[k], np.ones(width), "valid").argmax())
    rows = slice(first, first + width)
    before, after, P = closed.errors_before[k][rows], closed.errors_after[k][rows], segment.P[rows]
    lines: list[tuple[str, Floats, Colour]] = [("model before" if closed.extended else "model", before, "before")]
    if closed.extended:
        lines.append(("model after", after, "after"))
    powers = [Line("measured", P), *(Line(name, P - error, colour) for name, error, colour in lines)]
    residuals = [Line(name, error, colour) for name, error, colour in lines]
    alt = (
        f"Power of {segment.recording} over {width * step_s:.0f} s, measured and predicted. "
        f"The RMS residual of this extract is {_rms(before):.1f} W"
        + (f" before and {_rms(after):.1f} W after." if closed.extended else ".")
    )
    t = step_s * np.arange(first, first + width)
    panels = [Panel("P [W]", powers), Panel("error [W]", residuals, 120, zero=True)]
    return Chart(t, f"time in {segment.recording} [s]", panels, alt), segment.recording


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))


def correlation(closed: Closed) -> Chart:
    """Autocorrelation of the residual."""
    t = closed.subject.data.step_s * np.arange(1, _LAGS + 1)
    lines = [
        Line("model before" if closed.extended else "model", autocorrelation(closed.errors_before, _LAGS), "before")
    ]
    if closed.extended:
        lines.append(Line("model after", autocorrelation(closed.errors_after, _LAGS), "after"))
    alt = f"Autocorrelation of the residual at lags up to {t[-1]:.0f} s"
    return Chart(t, "lag [s]", [Panel("autocorrelation", lines, 170, zero=True)], alt)


def beliefs(each: Reported) -> Bars:
    """Confidence of a cause and of its alternatives; causes that the recordings cannot tell apart have one bar."""
    kin = [each.term.id, *(name for name, _ in each.family)]
    rows = [Bar(" or ".join(dict.fromkeys(kin)), each.family_confidence, percent(each.family_confidence), "after")]
    rows += [
        Bar(name, share, percent(share), "before" if name in library() else "muted")
        for name, share in each.alternatives
        if share >= LEAST_CONFIDENCE and name not in kin
    ]
    return ranked(rows, "Confidence [%]", whole=1.0)
