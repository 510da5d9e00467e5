"""The residual along recorded quantities: mean and RMS in bins, which show what the residual depends on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.segments import Segment

_LONGEST_AGE_S = 2.0


@dataclass(frozen=True, slots=True)
class Aspect:
    """The residual along one quantity: mean and spread in bins."""

    name: str
    unit: str
    middle: Floats
    mean: Floats
    """[bins] mean residual, W."""
    rms: Floats
    """[bins] RMS residual, W."""


def aspects(segments: list[Segment], errors: list[Floats], predicted: list[Floats], step_s: float) -> list[Aspect]:
    """The residual along speed and angle of every joint, load, mains voltage, time, temperature, time since events."""
    e = np.concatenate(errors)
    moved = [segment.motion(step_s) for segment in segments]
    q, qd = (np.concatenate([each[k] for each in moved]) for k in (0, 1))
    t = np.concatenate([s.start_s + step_s * np.arange(len(s.P)) for s in segments])
    along = [_binned(f"speed of joint {k + 1}", "rad/s", qd[:, k], e) for k in range(q.shape[1])]
    along += [_binned(f"angle of joint {k + 1}", "rad", q[:, k], e) for k in range(q.shape[1])]
    along.append(_binned("predicted power", "W", np.concatenate(predicted), e))
    along.append(_binned("time", "min", (t - t.min()) / 60, e))
    along.append(
        _binned("time in the recording", "s", np.concatenate([step_s * np.arange(len(s.P)) for s in segments]), e)
    )
    if all("Vrms" in segment.channels for segment in segments):
        along.append(_binned("mains voltage", "V", np.concatenate([s.channels["Vrms"] for s in segments]), e))
    if all("temperature" in segment.channels for segment in segments):
        warmest = np.concatenate([np.nanmax(s.channels["temperature"], axis=1) for s in segments])
        along.append(_binned("temperature of the warmest joint", "degC", warmest, e))
    for name in ("brake", "tool"):
        if all(name in segment.signals for segment in segments):
            along.append(
                _binned(
                    f"time since {name} came on",
                    "s",
                    np.concatenate([_age(s.signals[name], step_s) for s in segments]),
                    e,
                )
            )
    return [aspect for aspect in along if len(aspect.middle) > 1]


def _age(signal: Floats, step_s: float) -> Floats:
    """[T] s since a 0/1 signal rose, at most 2 s; NaN where it did not."""
    at = np.arange(len(signal))
    last = np.maximum.accumulate(np.where(np.diff(signal, prepend=signal[0]) > 0, at, -(10**9)))
    age = (at - last) * step_s
    return np.where(age <= _LONGEST_AGE_S, age, np.nan)


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
