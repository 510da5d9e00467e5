"""The residual, honestly: how large, how far from noise, and where it lives."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.residual.whitening import autocorrelation
from acqd.models.features import motion
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma, runs_of_true

_STILL_RAD_S = 0.005
_SETTLED_ROWS, _REST_ROWS, _LEAST_RESTS = 10, 50, 5
_LAGS = 25  # a second


@dataclass(frozen=True, slots=True)
class Quality:
    """Of predictions beside what was measured."""

    mae: float
    """W."""
    rmse: float
    """W."""
    bias: float
    """W, prediction minus measurement."""
    whiteness: float
    """RMS autocorrelation of the residual within one second: 0 for noise, 1 for what could all be foreseen."""

    def as_json(self) -> dict[str, float]:
        """For report.json."""
        return {name: float(value) for name, value in asdict(self).items()}


def quality(errors: list[Floats]) -> Quality:
    """Of residuals (measured minus predicted) [T] W per stretch."""
    together = np.concatenate(errors)
    rho = autocorrelation(errors, _LAGS)
    return Quality(
        float(np.abs(together).mean()),
        float(np.sqrt((together**2).mean())),
        float(-together.mean()),
        float(np.sqrt((rho**2).mean())),
    )


def noise_floor(segments: list[Segment], step_s: float) -> tuple[float, str]:
    """W RMS that no model of motion can explain, and where it was seen: at rest, else between neighbouring rows."""
    found = []
    for segment in segments:
        speed = np.abs(motion(segment.q, step_s)[1]).max(axis=1)
        for first, last in runs_of_true(speed < _STILL_RAD_S):
            rest = segment.P[first + _SETTLED_ROWS : last]
            found += [rest[k : k + _REST_ROWS].std() for k in range(0, len(rest) - _REST_ROWS + 1, _REST_ROWS)]
    if len(found) >= _LEAST_RESTS:  # the median: brakes and tools switch while the arm rests
        return float(np.median(found)), "at rest, within two seconds"
    second = np.concatenate([np.diff(segment.P, 2) for segment in segments])
    return mad_sigma(second, 0.0) / np.sqrt(6), "between neighbouring rows"


@dataclass(frozen=True, slots=True)
class Aspect:
    """The residual along one quantity: mean and spread in bins."""

    name: str
    unit: str
    middle: Floats
    mean: Floats
    """W."""
    rms: Floats
    """W."""


def aspects(segments: list[Segment], errors: list[Floats], predicted: list[Floats], step_s: float) -> list[Aspect]:
    """Where it lives: speed and angle of every joint, load, mains voltage, time, temperature, events."""
    e = np.concatenate(errors)
    moved = [motion(segment.q, step_s) for segment in segments]
    q, qd = (np.concatenate([each[k] for each in moved]) for k in (0, 1))
    t = np.concatenate([s.start_s + step_s * np.arange(len(s.P)) for s in segments])
    found = [_binned(f"speed of joint {k + 1}", "rad/s", qd[:, k], e) for k in range(q.shape[1])]
    found += [_binned(f"angle of joint {k + 1}", "rad", q[:, k], e) for k in range(q.shape[1])]
    found.append(_binned("predicted power", "W", np.concatenate(predicted), e))
    found.append(_binned("time", "min", (t - t.min()) / 60, e))
    found.append(
        _binned("time in the recording", "s", np.concatenate([step_s * np.arange(len(s.P)) for s in segments]), e)
    )
    if all("Vrms" in segment.channels for segment in segments):
        found.append(_binned("mains voltage", "V", np.concatenate([s.channels["Vrms"] for s in segments]), e))
    if all("temperature" in segment.channels for segment in segments):
        warmest = np.concatenate([np.nanmax(s.channels["temperature"], axis=1) for s in segments])
        found.append(_binned("temperature of the warmest joint", "degC", warmest, e))
    for name in ("brake", "tool"):
        if all(name in segment.signals for segment in segments):
            found.append(
                _binned(
                    f"time since {name} came on",
                    "s",
                    np.concatenate([_age(s.signals[name], step_s) for s in segments]),
                    e,
                )
            )
    return [aspect for aspect in found if len(aspect.middle) > 1]


def _age(signal: Floats, step_s: float) -> Floats:
    """[T] s since a 0/1 signal rose, at most 2 s; NaN where it did not."""
    at = np.arange(len(signal))
    last = np.maximum.accumulate(np.where(np.diff(signal, prepend=signal[0]) > 0, at, -(10**9)))
    age = (at - last) * step_s
    return np.where(age <= 2.0, age, np.nan)


def _binned(name: str, unit: str, x: Floats, e: Floats, bins: int = 20) -> Aspect:
    known = np.isfinite(x)
    x, e = x[known], e[known]
    if not len(x) or np.ptp(x) < 1e-9:
        return Aspect(name, unit, np.empty(0), np.empty(0), np.empty(0))
    edges = np.unique(np.quantile(x, np.linspace(0, 1, bins + 1)))
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(which, minlength=len(edges) - 1), 1)
    mean = np.bincount(which, e, len(edges) - 1) / count
    rms = np.sqrt(np.bincount(which, e**2, len(edges) - 1) / count)
    middle = np.bincount(which, x, len(edges) - 1) / count
    return Aspect(name, unit, middle, mean, rms)
