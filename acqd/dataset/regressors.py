"""Regressors of the metered power: physical quantities of each joint, computed from a robot's log.

The thesis correlates mechanical with electrical power (Eq. 6.1 to 6.4). A regression of the metered power on
several quantities of each joint has a sharper maximum over the lag and needs no tuning.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, lfilter, sosfiltfilt

from acqd.arrays import Floats, Singles
from acqd.errors import InputError
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inverse_dynamics
from acqd.robot.log import RobotLog, in_time

TorqueSource = Literal["measured", "model", "current"]
"""Joint torques from sensors, from the description's inverse dynamics, or motor currents instead of torques."""
STEP_S = 0.01
"""Step of the regressors' grid."""
_CUTOFF_HZ = 12.0  # well above BAND_HZ: smoothing the angles changes nothing below it
_ROUNDED_CUTOFF_HZ = 8.0  # for times in whole milliseconds: their rounding is noise of the accelerations
BAND_HZ = 2.5
"""Regressors and power are compared below this frequency; above it, encoder and recorder artefacts dominate."""
_CLOSE = 0.1
"""Step over the usual one, below which rows nearly coincide."""
_PAUSE_S = 0.25
"""Longest step that counts for the usual one."""
_SIGN_SPEED = 0.02  # rad/s, width of the smoothed sign of the speed
_PULSE_EDGES_S = (0.0, 0.12, 0.3, 0.6)
"""Edges of the pulses after the brakes have opened."""
_WHOLE_MS = 0.01  # a Unix time in a float resolves 0.0002 ms
_MIN_ROWS = 50
_MIN_S = 2.0
_GAP_S, _GAP_STEPS = 0.15, 2.0
"""Rows farther apart, and more than so many usual steps, leave the motion between them unknown: a cubic across 0.2 s
hides what moves at BAND_HZ, which looks like a longer lag of the supply."""
_SPREAD_S = 0.1
"""Time over which the filters spread what is unknown: two standard deviations of the one at BAND_HZ."""


@dataclass(frozen=True, slots=True)
class Regressors:
    """Regressors of one log on an even grid of the controller's clock."""

    start_s: float
    """Controller time of the first grid point."""
    columns: Floats | Singles
    """[T, k], neither delayed nor averaged; single precision: those of an hour take a tenth of a gigabyte."""
    mechanical_power: Floats
    """[T] W: torque times speed, summed over the joints (thesis Eq. 6.1 to 6.3)."""
    essential: int
    """How many of the first columns explain most; a search over hours with all columns would fit noise."""
    events: int = 0
    """How many of the last columns follow the brakes; no motion explains the power peak when they open."""
    known: NDArray[np.bool_] | None = None
    """[T] where the log tells the motion; None: everywhere."""
    age_error_s: float = 0.0
    """By how much all poses may be older than their stamps."""
    coarse: bool = False
    """Whether the poses had to be smoothed so much that fast motion is lost."""

    @property
    def searched(self) -> NDArray[np.int64]:
        """Indices of the columns for the coarse search."""
        last = np.arange(self.columns.shape[1] - self.events, self.columns.shape[1])
        return np.concatenate([np.arange(self.essential), last]).astype(np.int64)

    @property
    def t(self) -> Floats:
        """[T] s, controller time."""
        return np.asarray(self.start_s + STEP_S * np.arange(len(self.columns)))

    def as_metered(self, lag_s: float, window_s: float) -> Floats:
        """[T, k]: delayed by the supply's first-order lag, averaged over a meter's window around each point.

        The trapezoidal rule (Tustin's method) delays slow signals by exactly `lag_s` at any step.
        """
        return _averaged(behind_supply(self.columns.astype(np.float64), lag_s), window_s)


def behind_supply(columns: Floats, lag_s: float) -> Floats:
    """Columns [T, k] STEP_S apart, delayed by a supply's first-order lag."""
    if lag_s <= 0:
        return columns
    c = 2 * lag_s / STEP_S
    b, a = np.array([1.0, 1.0]) / (1 + c), np.array([1.0, (1 - c) / (1 + c)])
    delayed, _ = lfilter(b, a, columns, axis=0, zi=columns[:1] * (1 - b[0]))
    return np.asarray(delayed)


def band_limited(values: Floats, step_s: float) -> Floats:
    """Low-pass at BAND_HZ without delay, along the first axis.

    A Gaussian acts the same at every sampling rate. A digital Butterworth filter at the power's rate is steeper
    than one at the regressors' rate, and the difference would look like a lag of the supply.
    """
    deviation = np.sqrt(np.log(2) / 2) / (2 * np.pi * BAND_HZ) * np.sqrt(2)  # half the power at BAND_HZ
    return np.asarray(gaussian_filter1d(values, deviation / step_s, axis=0, mode="nearest"))


def regressors_of(log: RobotLog, robot: RobotDescription, torque: TorqueSource | None = None) -> Regressors:
    """Regressors of one log; without `torque`, from measured torques if logged. Raises InputError."""
    time, rows = in_time(log)
    if len(time) < _MIN_ROWS or time[-1] - time[0] < _MIN_S:
        raise InputError(log.path, f"{len(time)} rows over {time[-1] - time[0]:.1f} s are too few to be aligned")
    grid = np.arange(time[0], time[-1], STEP_S)
    cutoff_hz = _ROUNDED_CUTOFF_HZ if _rounded(time) else _CUTOFF_HZ
    q = _smooth(grid, time, log.q[rows], cutoff_hz)
    curve = CubicSpline(grid, q)  # differences of neighbours would blur like a supply's lag
    qd, qdd = np.asarray(curve(grid, 1)), np.asarray(curve(grid, 2))
    source = torque or best_torque(log)
    tau = _torque(source, log, robot, (grid, time, rows), (q, qd, qdd))
    direction = np.tanh(qd / _SIGN_SPEED)
    power = (tau * qd).sum(axis=1)
    columns = [np.abs(qd), qd**2, qd * qdd, tau * qd, tau**2, tau * direction, np.abs(power)[:, None]]
    essential = sum(column.shape[1] for column in columns)
    # the other terms of the copper loss, (tau + J qdd + friction)^2: without them, the time shift is biased
    columns += [qdd**2, tau * qdd, qdd * direction]
    events = 0
    if "brake" in log.signals and np.isfinite(log.signals["brake"]).all():  # last: not every log has it
        columns.append(_brake_columns(np.interp(grid, time, log.signals["brake"][rows])))
        events = columns[-1].shape[1]
    known = _known(grid, time)
    values = np.column_stack(columns).astype(np.float32)
    return Regressors(
        float(time[0]), values, power, essential, events, known, log.quality.age_error_s, log.quality.coarse
    )


def _known(grid: Floats, time: Floats) -> NDArray[np.bool_] | None:
    """[len(grid)] False in and near gaps of the log; None without a gap."""
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > max(_GAP_S, _GAP_STEPS * float(np.median(steps))))
    if not len(gaps):
        return None
    known = np.ones(len(grid), bool)
    for before in gaps:
        known[(grid > time[before] - _SPREAD_S) & (grid < time[before + 1] + _SPREAD_S)] = False
    return known


def _brake_columns(opened: Floats) -> Floats:
    """[T, k]: brakes open, and pulses after they have opened, where the power has a peak (thesis Figure 6.2)."""
    rises = np.flatnonzero(np.diff((opened > 0.5).astype(np.int8), prepend=np.int8(opened[0] > 0.5)) > 0)
    age = np.full(len(opened), np.inf)
    for row in rises:
        age[row:] = STEP_S * np.arange(len(opened) - row)
    pulses = [(age >= low) & (age < high) for low, high in itertools.pairwise(_PULSE_EDGES_S)]
    return np.column_stack([opened, *(pulse for pulse in pulses if pulse.any())]).astype(np.float64)


def best_torque(log: RobotLog) -> TorqueSource:
    """measured if the log has usable torques, else model: the description's inverse dynamics."""
    if log.tau is not None and np.isfinite(log.tau).all() and np.abs(log.tau).max() > 0:
        return "measured"
    return "model"


def _torque(
    source: TorqueSource,
    log: RobotLog,
    robot: RobotDescription,
    sampling: tuple[Floats, Floats, NDArray[np.int64]],
    motion: tuple[Floats, Floats, Floats],
) -> Floats:
    grid, time, rows = sampling
    if source == "model":
        return inverse_dynamics(robot, *motion)
    measured = log.tau if source == "measured" else log.current
    if measured is None:
        raise InputError(log.path, f"has no {'tau' if source == 'measured' else 'current'} columns")
    if not np.isfinite(measured).all():
        row = int(np.argmin(np.isfinite(measured).all(axis=1))) + 1
        raise InputError(
            log.path,
            f"data row {row}: a {'torque' if source == 'measured' else 'current'} is missing; use --torque model",
        )
    return _smooth(grid, time, measured[rows])


def _rounded(time: Floats) -> bool:
    """Whether all times are whole milliseconds, as a DataRecorder writes them."""
    ms = 1000 * (time - time[0])
    return bool(np.abs(ms - np.rint(ms)).max() < _WHOLE_MS)


def _smooth(grid: Floats, time: Floats, values: Floats, cutoff_hz: float = _CUTOFF_HZ) -> Floats:
    even = CubicSpline(*_apart(time, values))(
        grid
    )  # straight lines between 40 ms samples would blur like a supply's lag
    filtered = butter(2, cutoff_hz, fs=1 / STEP_S, output="sos")
    return np.asarray(sosfiltfilt(filtered, even, axis=0))


def _apart(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Times and values without rows that nearly coincide, as those of a packet: their means.

    A spline through two values of an encoder that are 0.1 ms apart swings far beyond both. Rows of a recorder that
    rests with the arm are close, too, in motion: means over more than STEP_S would lose it.
    """
    step = np.diff(time)
    usual = float(np.minimum(step, _PAUSE_S).mean())
    new = np.concatenate([[0], np.cumsum(step >= _CLOSE * usual)])
    begin = time[np.searchsorted(new, np.arange(new[-1] + 1))]
    piece = np.floor((time - begin[new]) / STEP_S)
    new = np.concatenate([[0], np.cumsum((np.diff(new) > 0) | (np.diff(piece) > 0))])
    if new[-1] == len(time) - 1:
        return time, values
    counts = np.bincount(new)
    means = [np.bincount(new, column) / counts for column in (time - time[0], *values.T)]
    return time[0] + means[0], np.column_stack(means[1:])


def _averaged(columns: Floats, window_s: float) -> Floats:
    """Mean over `window_s` around each point, by the integral of the straight lines between points."""
    half = window_s / STEP_S / 2
    ends = int(np.ceil(half)) + 1
    padded = np.pad(columns, ((ends, ends), (0, 0)), mode="edge")
    integral = np.concatenate([np.zeros((1, padded.shape[1])), np.cumsum((padded[1:] + padded[:-1]) / 2, axis=0)])
    whole, share = int(half), half - int(half)

    def integral_at(first: int, share: float) -> Floats:
        here, after = padded[first : first + len(columns)], padded[first + 1 : first + 1 + len(columns)]
        return np.asarray(integral[first : first + len(columns)] + here * share + (after - here) * (share**2 / 2))

    upper, lower = integral_at(ends + whole, share), integral_at(ends - whole - 1, 1 - share)
    return np.asarray((upper - lower) / (2 * half))
