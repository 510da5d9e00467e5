"""The report of a dataset: how one typical recording was merged, and the lags of all recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from acqd.dataset.align import SEARCH_S
from acqd.dataset.figures import (
    before_and_after_figure,
    clock_line_figure,
    correlation_figure,
    resampling_figure,
    shift_figure,
)
from acqd.dataset.merged_log import MergedLog
from acqd.dataset.placement import Alignment
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import Regressors
from acqd.report import Page


def report_writer(
    title: str, power: PowerStream, alignment: Alignment, merged: list[MergedLog], regressors: list[Regressors]
) -> Callable[[Path], None]:
    """A function that writes report.html into a folder; it writes nothing if the lags were given.

    The report shows the recording whose R^2 is the median.
    """
    placed = [k for k, single in enumerate(merged) if single.recording is not None]
    if not regressors or not placed:
        return lambda _: None
    typical = sorted(placed, key=lambda k: merged[k].placement.own.r2)[len(placed) // 2]

    def write(folder: Path) -> None:
        page = Page(title, simulated=power.measured == "simulated")
        _merging(page, power, merged[typical])
        _time_shift(page, power, regressors[typical], merged[typical].placement.lag_s)
        page.heading("Lags of all recordings")
        middles = np.array([float(single.t.mean()) for single in regressors])
        figure = clock_line_figure(middles, alignment.placements, alignment.line)
        page.figure(figure, "Controller clock minus power clock, from single recordings, and the line through them.")
        for note in alignment.notes:
            page.text(note)
        _lag_table(page, merged)
        page.write(folder / "report.html")

    return write


def _lag_table(page: Page, merged: list[MergedLog]) -> None:
    """Lag, interval and origin of every recording."""
    rows = [
        [single.log.path.stem, f"{place.lag_s:.4f}", _in_ms(place.within_s), place.method, place.note]
        for single in merged
        if (place := single.placement).method != "refused"
    ]
    page.table(["recording", "lag [s]", "+- 95 % [ms]", "from", "note"], rows)


def _in_ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1000 * seconds:.1f}"


def _merging(page: Page, power: PowerStream, merged: MergedLog) -> None:
    assert merged.recording is not None
    page.heading("Merging")
    figure = resampling_figure(merged.log, power, merged.placement, merged.recording)
    name = merged.recording.name
    page.figure(figure, f"{name}: above as recorded, below on the common time vector (compare thesis Figure 6.1).")


def _time_shift(page: Page, power: PowerStream, regressors: Regressors, lag_s: float) -> None:
    t, mechanical = regressors.t, regressors.mechanical_power
    page.heading("Time shift")
    assumed_s = 0.0 if abs(lag_s) < SEARCH_S else round(lag_s)
    page.figure(
        shift_figure(t, mechanical, power, assumed_s, lag_s),
        "Mechanical power (torque times speed, summed over the joints) and electrical power on their own clocks "
        "(compare thesis Figure 6.2).",
    )
    page.figure(
        correlation_figure(t, mechanical, power, lag_s),
        f"Cross-correlation of the two (thesis Eq. 6.4, Figure 6.3); the lag found by regression is {lag_s:.4f} s.",
    )
    page.figure(
        before_and_after_figure(t, mechanical, power, lag_s),
        "Before and after the shift, over time and against each other (compare thesis Figure 6.4).",
    )
