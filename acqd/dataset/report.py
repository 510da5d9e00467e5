"""The report of a dataset: what was merged and how exactly, one typical recording, and the lags of all recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.dataset.align import SEARCH_S
from acqd.dataset.config import BuildConfig
from acqd.dataset.figures import (
    before_and_after_figure,
    clock_line_figure,
    correlation,
    correlation_figure,
    electrical_power,
    resampling_figure,
)
from acqd.dataset.merged_log import Batch, MergedLog
from acqd.dataset.regressors import STEP_S, Regressors
from acqd.numerics import NORMAL_95
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import FEWEST_FOR_INTERVAL, counted, duration
from acqd.report.lines import Chart, Line, Panel
from acqd.storage.url import shown

_SHOWN_S = 60.0
_NOT_MERGED = 0.05
"""Share of logs that may be refused before the verdict is open."""


@dataclass(frozen=True, slots=True)
class _Typical:
    """The recording whose R^2 is the median."""

    merged: MergedLog
    regressors: Regressors
    r_ignored: float
    """Correlation of mechanical and electrical power with the lag ignored."""
    r_removed: float


def report_writer(
    title: str, config: BuildConfig, batch: Batch, regressors: list[Regressors]
) -> Callable[[Path], None]:
    """A function that writes report.html into a folder; it writes nothing if the lags were given."""
    placed = [k for k, single in enumerate(batch.merged) if single.recording is not None]
    if not regressors or not placed:
        return lambda _: None
    k = sorted(placed, key=lambda k: batch.merged[k].placement.own.r2)[len(placed) // 2]
    ignored, removed = (_correlation(batch, regressors[k], lag) for lag in _lags(batch.merged[k]))
    typical = _Typical(batch.merged[k], regressors[k], ignored, removed)

    def write(folder: Path) -> None:
        page = Page(
            title, simulated=batch.powers[0].measured == "simulated", kind="dataset", subject=Path(config.robot).stem
        )
        page.verdict(_verdict(batch, typical))
        page.lines(_chart(batch, typical), _caption(typical), "Compare thesis Figures 6.2 and 6.4.")
        _lags_of_all(page, batch, regressors)
        _time_shift(page, batch, typical)
        _merging(page, batch, typical)
        _left_out(page, batch)
        page.detail("seed", config.seed)
        page.detail("power", shown(config.power))
        page.detail("logs", config.logs)
        page.write(folder / "report.html")

    return write


def _lags(merged: MergedLog) -> tuple[float, float]:
    """The lag that one would assume, and the one found: s."""
    lag_s = merged.placement.lag_s
    return (0.0 if abs(lag_s) < SEARCH_S else round(lag_s)), lag_s


def _correlation(batch: Batch, regressors: Regressors, lag_s: float) -> float:
    return correlation(regressors.mechanical_power, electrical_power(regressors.t - lag_s, batch.powers[0]))


def _verdict(batch: Batch, typical: _Typical) -> Verdict:
    merged = [single.recording for single in batch.merged if single.recording is not None]
    total = len(batch.merged) + len(batch.refused)
    seconds = sum(float(recording.valid.sum()) for recording in merged) * _step_s(merged[0].time_ns)
    headline = f"{len(merged)} of {counted(total, 'log')} merged with their power"
    figures = [
        KeyFigure("valid rows", duration(seconds), counted(len(merged), "recording")),
        _clock(batch),
        KeyFigure("correlation of the powers", f"{typical.r_ignored:.2f} → {typical.r_removed:.2f}",
                  f"mechanical and electrical, lag ignored and removed; {typical.merged.log.path.stem}"),
    ]  # fmt: skip
    whole = total - len(merged) <= _NOT_MERGED * total
    steps = [] if whole else ["look at the logs that were left out, listed below with their reasons"]
    return Verdict("fine" if whole else "open", headline, _noted(batch), figures, steps)


def _step_s(time_ns: np.ndarray) -> float:
    return float(np.median(np.diff(time_ns))) * 1e-9


def _noted(batch: Batch) -> str:
    notes = batch.alignment.notes
    return f"{notes[0][0].upper()}{notes[0][1:]}." if notes else ""


def _clock(batch: Batch) -> KeyFigure:
    """Offset and drift of the robot's clock, or the lag of the typical recording."""
    line, count = batch.alignment.line, len(batch.alignment.placements)
    if line is None:
        lags = [place.lag_s for place in batch.alignment.placements if place.method != "refused"]
        return KeyFigure(
            "lags", f"{min(lags):.3f} to {max(lags):.3f} s", f"no common clock line; {counted(count, 'log')}"
        )
    known = [place.within_s for place in batch.alignment.placements if place.within_s is not None]
    half_ms = 1000 * max(NORMAL_95 * line.offset_error_s, float(np.median(known or [0.0])))  # with the supply's lag
    within = f"± {half_ms:.1f} ms (95 %, {count} recordings); " if count >= FEWEST_FOR_INTERVAL else ""
    note = f"{within}drift {line.drift_ppm:+.1f} ppm"
    return KeyFigure("robot clock is off by", f"{line.offset_s:+.3f} s", note)


def _chart(batch: Batch, typical: _Typical) -> Chart:
    """Both powers of the typical recording with the lag ignored and removed."""
    t, mechanical = typical.regressors.t, typical.regressors.mechanical_power
    rows = slice(0, min(len(t), int(_SHOWN_S / STEP_S)))
    panels = []
    for text, lag_s in zip(("lag ignored", "lag removed"), _lags(typical.merged), strict=True):
        electrical = electrical_power(t[rows] - lag_s, batch.powers[0])
        above_rest = electrical - np.nanpercentile(electrical, 5) if np.isfinite(electrical).any() else electrical
        lines = [
            Line("electrical power above rest", above_rest, "before"),
            Line("mechanical power", mechanical[rows], "after"),
        ]
        panels.append(Panel(f"{text}: P [W]", lines, 170))
    alt = (
        f"Mechanical and electrical power of {typical.merged.log.path.stem}: their correlation is "
        f"{typical.r_ignored:.2f} before and {typical.r_removed:.2f} after the shift"
    )
    return Chart(t[rows] - t[0], "time [s]", panels, alt)


def _caption(typical: _Typical) -> str:
    assumed, lag_s = _lags(typical.merged)
    return (
        f"{typical.merged.log.path.stem}: both powers with a lag of {assumed:.0f} s (top) and of {lag_s:.4f} s "
        "(bottom)."
    )


def _lags_of_all(page: Page, batch: Batch, regressors: list[Regressors]) -> None:
    page.heading("Lags of all recordings")
    middles = np.array([float(single.t.mean()) for single in regressors])
    figure = clock_line_figure(middles, batch.alignment.placements, batch.alignment.line)
    page.figure(figure, "Controller clock minus power clock, from single recordings, and the line through them.")
    for note in batch.alignment.notes:
        page.text(note)
    rows = [
        [single.log.path.stem, f"{place.lag_s:.4f}", _in_ms(place.within_s), place.method, single.reason or place.note]
        for single in batch.merged
        if (place := single.placement).method != "refused"
    ]
    with page.folded(f"Table of {counted(len(rows), 'recording')}"):
        page.table(["recording", "lag [s]", "± 95 % [ms]", "from", "note"], rows)


def _left_out(page: Page, batch: Batch) -> None:
    page.heading("Logs that were left out")
    rows = [[single.log.path.stem, single.reason] for single in batch.merged if single.recording is None]
    if rows:
        page.table(["log", "reason"], rows)
    for note in batch.refused:
        page.text(note)


def _in_ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1000 * seconds:.1f}"


def _merging(page: Page, batch: Batch, typical: _Typical) -> None:
    assert typical.merged.recording is not None
    page.heading("Merging")
    name = typical.merged.recording.name
    figure = resampling_figure(typical.merged.log, batch.powers[0], typical.merged.placement, typical.merged.recording)
    caption = f"{name}: above as recorded, below on the common time vector."
    page.figure(figure, caption, source="Compare thesis Figure 6.1.")


def _time_shift(page: Page, batch: Batch, typical: _Typical) -> None:
    t, mechanical = typical.regressors.t, typical.regressors.mechanical_power
    lag_s = typical.merged.placement.lag_s
    page.heading("Time shift")
    page.figure(
        correlation_figure(t, mechanical, batch.powers[0], lag_s),
        f"Cross-correlation of mechanical power (torque times speed, summed over the joints) and electrical power; "
        f"the lag by regression is {lag_s:.4f} s.",
        source="Thesis Eq. 6.4, Figure 6.3.",
    )
    page.figure(
        before_and_after_figure(t, mechanical, batch.powers[0], lag_s),
        "Before and after the shift, against each other.",
        source="Compare thesis Figure 6.4.",
    )
