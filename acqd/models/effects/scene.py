"""A stretch of recording as effects see it: motion at four points a row, torques, powers, signals.

A meter averages over its window; physics computed at the window's middle only is wrong wherever the arm speeds up,
stops or turns round, and those errors look like brakes and Stribeck friction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.models.features import padded
from acqd.models.greybox.model import SMALL_TORQUE, GreyBox, lag_filter, magnitude

SUBSTEPS = 4
"""Points a row."""
RADIUS = 2
"""Rows to either side that a row's motion is interpolated from."""


def substep_weights(step_s: float) -> Floats:
    """[3, SUB, 2 RADIUS + 1]: value, first and second derivative of the interpolating polynomial."""
    nodes = np.arange(-RADIUS, RADIUS + 1) * 1.0
    points = (np.arange(SUBSTEPS) + 0.5) / SUBSTEPS - 0.5
    inverse = np.linalg.inv(np.vander(nodes, increasing=True))  # coefficients of the polynomial per node
    powers = np.arange(len(nodes))
    found = np.zeros((3, SUBSTEPS, len(nodes)))
    for k, x in enumerate(points):
        found[0, k] = x**powers @ inverse
        found[1, k] = (powers[1:] * x ** (powers[1:] - 1)) @ inverse[1:] / step_s
        found[2, k] = (powers[2:] * (powers[2:] - 1) * x ** (powers[2:] - 2)) @ inverse[2:] / step_s**2
    return found


def substep_motion(q: Floats, step_s: float) -> tuple[Floats, Floats, Floats]:
    """q, qd, qdd [SUB T, axes] from angles [T + 2 RADIUS, axes]."""
    rows = len(q) - 2 * RADIUS
    around = np.stack([q[k : k + rows] for k in range(2 * RADIUS + 1)], axis=1)  # [T, nodes, axes]
    fine = np.einsum("dsn,tna->dtsa", substep_weights(step_s), around, optimize=True)
    return tuple(each.reshape(rows * SUBSTEPS, q.shape[1]) for each in fine)


def averaged(fine: Floats) -> Floats:
    """[T, ...] means over the rows of values [SUB T, ...]."""
    return np.asarray(fine.reshape(-1, SUBSTEPS, *fine.shape[1:]).mean(axis=1))


class Lag:
    """The supply's first-order lag at the fine step; goes on where it stopped."""

    def __init__(self, lag_s: float, step_s: float) -> None:
        self._b, self._a = lag_filter(lag_s, step_s / SUBSTEPS)
        self._state: Floats | None = None

    def run(self, values: Floats) -> Floats:
        """Behind the lag, along the first axis, from rest at the very first value."""
        if self._state is None:
            self._state = values[:1] * (1 - self._b[0])
        out, self._state = lfilter(self._b, self._a, values, axis=0, zi=self._state)
        return np.asarray(out)


@dataclass(slots=True)
class Scene:
    """Arrays over fine points [N = SUB T] unless said otherwise; powers are at the mains, before the supply's lag."""

    step_s: float
    """Of rows."""
    t: Floats
    """s, UTC."""
    q: Floats
    qd: Floats
    qdd: Floats
    tau_rigid: Floats
    """[N, axes] Nm of the described body."""
    tau: Floats
    """[N, axes] Nm at the motors, at the output side."""
    power_per_torque: Floats
    """[N, axes] W/Nm: power per torque at the motor, mechanical and losses."""
    model: GreyBox
    """Where torques and powers come from."""
    drives: Floats
    """[N] W of motion, without standby."""
    predicted: Floats
    """[T] W: the grey box' prediction of the row, behind the lag."""
    signals: dict[str, Floats]
    """[N] 0/1 each; "tool", "brake"."""
    volts: Floats | None
    """[T] V."""
    temperature: Floats | None
    """[N, axes] degC."""
    memory: dict[str, Any] = field(default_factory=dict)
    """What effects with a state keep from one row to the next."""
    computed: dict[str, Any] = field(default_factory=dict)
    """What several effects need, computed by the first of them."""
    moved: dict[str, Any] = field(default_factory=dict)
    """The same, of motion alone: holds whatever the power per torque."""

    @property
    def rows(self) -> int:
        """T."""
        return len(self.predicted)

    @property
    def axes(self) -> int:
        """Joints."""
        return int(self.q.shape[1])

    @property
    def substep_s(self) -> float:
        """Between fine points."""
        return self.step_s / SUBSTEPS

    def with_secant_slope(self, torque: Floats) -> Scene:
        """The same with the mean power per torque [W/Nm] on the way to `torque` [N, axes] Nm more at the motors.

        Losses grow with the square of torque: what 4 kg take is not twice what 2 kg take.
        """
        loss = motor_loss(self.model, self.tau + torque) - motor_loss(self.model, self.tau)
        small = (np.abs(torque) < 1e-6) | (self.power_per_torque == 0.0)  # at nought where the brakes hold the arm
        secant = self.model.group("gain")[0] * self.qd + loss / np.where(small, 1.0, torque)
        return replace(self, power_per_torque=np.where(small, self.power_per_torque, secant), computed={})

    def unit_torque(self, joint: int) -> Scene:
        """The same with 1 W/Nm at one joint: what an effect that is a torque gives here is that torque."""
        return replace(
            self, power_per_torque=np.zeros_like(self.power_per_torque) + (np.arange(self.axes) == joint), computed={}
        )


def motor_loss(model: GreyBox, tau: Floats) -> Floats:
    """[N, axes] W lost between mains and motor at torques [N, axes] Nm."""
    return np.asarray(tau**2 * model.group("copper") + magnitude(tau) * model.group("conduction"))


def make_scene(
    model: GreyBox,
    q: Floats,
    signals: dict[str, Floats],
    start_s: float,
    volts: Floats | None = None,
    temperature: Floats | None = None,
    lag: Lag | None = None,
) -> Scene:
    """From angles [T + 2 RADIUS, axes] and rows [T] of the rest."""
    step_s = model.step_s
    qf, qd, qdd = substep_motion(q, step_s)
    rows = len(q) - 2 * RADIUS
    switches = {name: substep_switch(values) for name, values in signals.items()}
    on = np.reshape(model.drives_on(switches), (-1, 1))
    rigid, motor = (on * torque for torque in model.motor_torque(qf, qd, qdd))
    gain, copper, conduction = (model.group(name) for name in ("gain", "copper", "conduction"))
    power_per_torque = on * (gain[0] * qd + 2 * copper * motor + conduction * motor / np.hypot(motor, SMALL_TORQUE))
    drives = gain[0] * (motor * qd).sum(axis=1) + motor_loss(model, motor).sum(axis=1)
    lag = lag or Lag(float(model.group("lag")[0]), step_s)
    predicted = averaged(lag.run(drives)) + float(model.group("standby")[0])
    for name, weight in zip(model.signals, model.group("signals"), strict=True):
        predicted = predicted + weight * signals.get(name, np.zeros(rows))
    t = start_s + ((np.arange(rows * SUBSTEPS) + 0.5) / SUBSTEPS - 0.5) * step_s
    return Scene(
        step_s, t, qf, qd, qdd, rigid, motor, power_per_torque, model, drives, predicted,
        switches, volts, None if temperature is None else np.repeat(temperature, SUBSTEPS, axis=0),
    )  # fmt: skip


def substep_switch(share: Floats) -> Floats:
    """[SUB T] 0/1 from the share [T] of each row in which a signal is on: it switches once within a row."""
    after, before = np.append(share[1:], share[-1:]), np.append(share[:1], share[:-1])
    rising = (after > before)[:, None]
    points = (np.arange(SUBSTEPS) + 0.5) / SUBSTEPS
    on = np.where(rising, points > 1 - share[:, None], points < share[:, None])
    return np.asarray(on.ravel(), dtype=np.float64)


def scene_of(
    model: GreyBox, q: Floats, signals: dict[str, Floats], start_s: float, channels: dict[str, Floats]
) -> Scene:
    """Of a whole recording: angles [T, axes]."""
    return make_scene(model, padded(q, RADIUS), signals, start_s, channels.get("Vrms"), channels.get("temperature"))
