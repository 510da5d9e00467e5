"""Figures of a dataset's report: one recording before and after merging, and the lags of all recordings."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acqd.arrays import Floats
from acqd.dataset.align import SEARCH_S
from acqd.dataset.clock_line import ClockLine
from acqd.dataset.merge import Recording
from acqd.dataset.placement import Placement
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import STEP_S
from acqd.robot.log import RobotLog

_EXTRACT_S = 0.6
_MOTION_COLOUR, _POWER_COLOUR = "#3b82c4", "#d9480f"


def resampling_figure(log: RobotLog, power: PowerStream, placement: Placement, recording: Recording) -> Figure:
    """A short extract where joint 1 is fastest: samples as recorded, and rows on the common time vector."""
    speed = np.abs(np.gradient(recording.columns["q1"])) if len(recording.time_ns) > 2 else np.zeros(1)
    centre = recording.time_ns[int(np.argmax(speed))] * 1e-9
    begin, end = centre - _EXTRACT_S / 2, centre + _EXTRACT_S / 2
    rows = power.part(round(begin * 1e9), round(end * 1e9))
    centres = np.asarray(power.time_ns[rows] * 1e-9 + power.window_ns * 0.5e-9, dtype=np.float64)
    electrical = centres, np.asarray(power.P[rows])
    controller = log.time - placement.lag_s
    near = np.abs(controller - centre) < _EXTRACT_S / 2
    angles = controller[near], log.q[near, 0]
    t = recording.time_ns * 1e-9
    near = np.abs(t - centre) < _EXTRACT_S / 2
    merged = (t[near], recording.columns["P"][near]), (t[near], recording.columns["q1"][near])
    figure = Figure(figsize=(10, 5.5))
    upper, lower = figure.subplots(2, 1, sharex=True)
    _extract(upper, electrical, angles, centre)
    upper.set_title("recorded, lag removed", fontsize=9)
    _extract(lower, *merged, centre)
    lower.set_title("resampled", fontsize=9)
    lower.set_xlabel("time [s]")
    return figure


def _extract(axes: Axes, power: tuple[Floats, Floats], angle: tuple[Floats, Floats], centre: float) -> None:
    right = axes.twinx()
    axes.plot(power[0] - centre, power[1], "D-", ms=4, lw=0.6, color=_POWER_COLOUR)
    right.plot(angle[0] - centre, angle[1], "s-", ms=4, lw=0.6, color=_MOTION_COLOUR)
    axes.set_ylabel("electrical power [W]", color=_POWER_COLOUR)
    right.set_ylabel("angle of joint 1 [rad]", color=_MOTION_COLOUR)


def correlation_figure(t: Floats, mechanical: Floats, power: PowerStream, lag_s: float) -> Figure:
    """Normalised cross-correlation of mechanical and electrical power within SEARCH_S."""
    centre = 0.0 if abs(lag_s) < SEARCH_S else lag_s
    lags = centre + np.arange(-SEARCH_S, SEARCH_S + 1e-9, 0.01)
    values = [correlation(mechanical, electrical_power(t - lag, power)) for lag in lags]
    figure = Figure(figsize=(10, 3))
    axes = figure.subplots()
    axes.plot(lags, values, color=_MOTION_COLOUR)
    if np.isfinite(values).any():  # a log of a few seconds has no correlation coefficient
        best = float(lags[int(np.nanargmax(values))])
        axes.axvline(best, color="#52606d", lw=0.8, label=f"maximum of the cross-correlation {best:.2f} s")
    axes.axvline(lag_s, color=_POWER_COLOUR, lw=0.8, ls="--", label=f"lag used {lag_s:.4f} s")
    axes.set_xlabel("lag [s]")
    axes.set_ylabel("correlation coefficient [-]")
    axes.legend()
    return figure


def before_and_after_figure(t: Floats, mechanical: Floats, power: PowerStream, lag_s: float) -> Figure:
    """Scatter plots of both powers, with the lag ignored and with the lag removed."""
    figure = Figure(figsize=(8, 3.6))
    ignored = 0.0 if abs(lag_s) < SEARCH_S else round(lag_s)
    for axes, lag in zip(figure.subplots(1, 2, sharey=True), (ignored, lag_s), strict=True):
        electrical = electrical_power(t - lag, power)
        axes.plot(mechanical, electrical, ".", ms=1, color=_MOTION_COLOUR, rasterized=True)
        axes.set_title(f"lag {lag:.4g} s: r = {correlation(mechanical, electrical):.3f}", fontsize=9)
        axes.set_xlabel("mechanical power [W]")
        axes.set_ylabel("electrical power [W]")
    figure.tight_layout()
    return figure


def clock_line_figure(times_s: Floats, placements: list[Placement], line: ClockLine | None) -> Figure:
    """Credible lags of single recordings over the controller's time, and the clock line."""
    figure = Figure(figsize=(10, 3))
    axes = figure.subplots()
    hours = (times_s - times_s.min()) / 3600
    credible = np.array([placement.own.credible for placement in placements])
    lags = np.array([placement.own.seconds for placement in placements])
    within = np.array([placement.within_s or 0.0 for placement in placements])
    at, values, label = hours[credible], lags[credible], "single recordings, lag +- 95 %"
    axes.errorbar(at, values, within[credible], fmt="o", ms=3, elinewidth=0.8, color=_MOTION_COLOUR, label=label)
    if line is not None:
        order = np.argsort(times_s)
        axes.plot(hours[order], np.asarray(line.at(times_s[order])), color=_POWER_COLOUR, lw=1, label="clock line")
    axes.set_xlabel("controller time [h]")
    axes.set_ylabel("lag [s]")
    axes.legend()
    return figure


def electrical_power(at: Floats, power: PowerStream) -> Floats:
    """Power at times of the power clock; NaN beyond the stream."""
    rows = power.part(round((at[0] - 1) * 1e9), round((at[-1] + 1) * 1e9))
    P = np.asarray(power.P[rows])
    known = np.isfinite(P)
    if known.sum() < 2:
        return np.full(len(at), np.nan)
    centres = power.time_ns[rows][known] * 1e-9 + power.window_ns * 0.5e-9
    return np.asarray(np.interp(at, centres, P[known], left=np.nan, right=np.nan))


def correlation(a: Floats, b: Floats) -> float:
    """Pearson's r over the rows where both are known; NaN for less than 3 s."""
    known = np.isfinite(a) & np.isfinite(b)
    if known.sum() < 3 / STEP_S or b[known].std() == 0 or a[known].std() == 0:
        return float("nan")
    return float(np.corrcoef(a[known], b[known])[0, 1])
