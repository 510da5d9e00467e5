"""The thesis' Figures 6.1 to 6.4 for one recording, and all recordings' lags on their clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acqd.arrays import Floats
from acqd.dataset.align import SEARCH_S
from acqd.dataset.clock_line import ClockLine
from acqd.dataset.merge import Recording
from acqd.dataset.placement import Located
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S, Explanation
from acqd.report import Page
from acqd.robot.log import RobotLog

_EXTRACT_S = 0.6


def write_report(
    path: Path,
    title: str,
    power: PowerStream,
    shown: tuple[RobotLog, Explanation, Located, Recording],
    clock: tuple[Floats, list[Located], ClockLine | None],
) -> None:
    """One page. Raises UserError."""
    log, about, located, recording = shown
    page = Page(title, simulated=power.measured == "simulated")
    page.heading("Merging (Figure 6.1)")
    page.figure(resampling(log, power, located, recording), f"{recording.name}: above as recorded, below on one clock.")
    page.heading("Time shift (Figures 6.2 to 6.4)")
    mechanical, t = about.mechanical_power, about.t
    page.figure(
        beside(t, mechanical, power, 0.0 if abs(located.lag_s) < SEARCH_S else round(located.lag_s), located.lag_s),
        "Mechanical power (torque times speed, summed) and electrical power by the clocks as they were.",
    )
    page.figure(
        correlation(t, mechanical, power, located.lag_s),
        f"Cross-correlation (Eq. 6.4) of the two; the lag found by regression is {located.lag_s:.4f} s.",
    )
    page.figure(
        before_and_after(t, mechanical, power, located.lag_s),
        "Before and after the shift, over time and against each other.",
    )
    page.heading("Lags of all recordings")
    page.figure(
        clock_line(*clock), "Controller clock minus power clock, each recording alone, and the line through them."
    )
    page.write(path)


def resampling(log: RobotLog, power: PowerStream, located: Located, recording: Recording) -> Figure:
    """A short extract: samples as recorded, and rows on the common time vector."""
    speed = np.abs(np.gradient(recording.columns["q1"])) if len(recording.time_ns) > 2 else np.zeros(1)
    centre = recording.time_ns[int(np.argmax(speed))] * 1e-9
    figure = Figure(figsize=(10, 5.5))
    for axes, merged in zip(figure.subplots(2, 1, sharex=True), (False, True), strict=True):
        right = axes.twinx()
        if merged:
            t = recording.time_ns * 1e-9
            near = np.abs(t - centre) < _EXTRACT_S / 2
            electrical, angles = (t[near], recording.columns["P"][near]), (t[near], recording.columns["q1"][near])
        else:
            rows = power.part(round((centre - _EXTRACT_S / 2) * 1e9), round((centre + _EXTRACT_S / 2) * 1e9))
            electrical = power.time_ns[rows] * 1e-9 + power.window_ns * 0.5e-9, np.asarray(power.P[rows])
            own = log.time - located.lag_s
            near = np.abs(own - centre) < _EXTRACT_S / 2
            angles = own[near], log.q[near, 0]
        axes.plot(
            electrical[0] - centre,
            electrical[1],
            "D-",
            ms=4,
            lw=0.6,
            color="#d9480f",
            label=None if merged else "P [W]",
        )
        right.plot(
            angles[0] - centre, angles[1], "s-", ms=4, lw=0.6, color="#3b82c4", label=None if merged else "q1 [rad]"
        )
        axes.set_ylabel("P [W]")
        right.set_ylabel("q1 [rad]")
        axes.set_title("resampled" if merged else "recorded, lag removed", fontsize=9)
    axes.set_xlabel("s")
    figure.legend(loc="upper right", ncols=2)
    return figure


def beside(t: Floats, mechanical: Floats, power: PowerStream, assumed_s: float, lag_s: float) -> Figure:
    """Both powers over time, were the lag the assumed one."""
    figure = Figure(figsize=(10, 3.2))
    axes = figure.subplots()
    _both(axes, t, mechanical, power, assumed_s)
    axes.set_title(f"lag assumed {assumed_s:.3f} s, found {lag_s:.4f} s", fontsize=9)
    return figure


def correlation(t: Floats, mechanical: Floats, power: PowerStream, lag_s: float) -> Figure:
    """Normalised cross-correlation over the thesis' range."""
    centre = 0.0 if abs(lag_s) < SEARCH_S else lag_s
    lags = centre + np.arange(-SEARCH_S, SEARCH_S + 1e-9, 0.01)
    values = [_correlation(mechanical, _electrical(t - lag, power)) for lag in lags]
    figure = Figure(figsize=(10, 3))
    axes = figure.subplots()
    axes.plot(lags, values, color="#3b82c4")
    best = float(lags[int(np.nanargmax(values))])
    axes.axvline(best, color="#52606d", lw=0.8, label=f"maximum of the cross-correlation {best:.2f} s")
    axes.axvline(lag_s, color="#d9480f", lw=0.8, ls="--", label=f"lag used {lag_s:.4f} s")
    axes.set_xlabel("lag [s]")
    axes.set_ylabel("correlation")
    axes.legend()
    return figure


def before_and_after(t: Floats, mechanical: Floats, power: PowerStream, lag_s: float) -> Figure:
    """Time domain and scatter, with the lag ignored and removed."""
    figure = Figure(figsize=(11, 5.5))
    panels = figure.subplots(2, 2, width_ratios=(3, 1))
    ignored = 0.0 if abs(lag_s) < SEARCH_S else round(lag_s)
    for (over_time, scatter), lag in zip(panels, (ignored, lag_s), strict=True):
        _both(over_time, t, mechanical, power, lag)
        electrical = _electrical(t - lag, power)
        scatter.plot(mechanical, electrical, ".", ms=1, color="#3b82c4")
        scatter.set_title(f"r {_correlation(mechanical, electrical):.3f}", fontsize=9)
        scatter.set_xlabel("mechanical [W]")
    figure.tight_layout()
    return figure


def clock_line(times_s: Floats, located: list[Located], line: ClockLine | None) -> Figure:
    """Every recording's own lag, and the common clock."""
    figure = Figure(figsize=(10, 3))
    axes = figure.subplots()
    hours = (times_s - times_s.min()) / 3600
    credible = np.array([each.own.credible for each in located])
    own = np.array([each.own.seconds for each in located])
    axes.plot(hours[credible], own[credible], "o", ms=3, color="#3b82c4", label="alone")
    if line is not None:
        order = np.argsort(times_s)
        axes.plot(hours[order], np.asarray(line.at(times_s[order])), color="#d9480f", lw=1, label="clock")
    axes.set_xlabel("h")
    axes.set_ylabel("lag [s]")
    axes.legend()
    return figure


def _both(axes: Axes, t: Floats, mechanical: Floats, power: PowerStream, lag_s: float) -> None:
    axes.plot(t - t[0], mechanical, color="#3b82c4", lw=0.8, label="mechanical")
    electrical = _electrical(t - lag_s, power)
    rest = np.nanpercentile(electrical, 5)
    axes.plot(t - t[0], electrical - rest, color="#d9480f", lw=0.8, label=f"electrical - {rest:.0f} W")
    axes.set_ylabel("W")
    axes.set_xlabel("s")
    axes.legend(fontsize=8, loc="upper right")


def _electrical(at: Floats, power: PowerStream) -> Floats:
    """Power at times of the power clock; NaN beyond the stream."""
    rows = power.part(round((at[0] - 1) * 1e9), round((at[-1] + 1) * 1e9))
    P = np.asarray(power.P[rows])
    known = np.isfinite(P)
    if known.sum() < 2:
        return np.full(len(at), np.nan)
    centres = power.time_ns[rows][known] * 1e-9 + power.window_ns * 0.5e-9
    return np.asarray(np.interp(at, centres, P[known], left=np.nan, right=np.nan))


def _correlation(a: Floats, b: Floats) -> float:
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < 3 / STEP_S or b[both].std() == 0 or a[both].std() == 0:
        return float("nan")
    return float(np.corrcoef(a[both], b[both])[0, 1])
