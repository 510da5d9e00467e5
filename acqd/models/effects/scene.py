"""A segment of a recording as effects see it: motion at substeps, torques, powers, signals."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.substeps import RADIUS, SUBSTEPS, Lag, substep_motion, substep_switch, substep_times
from acqd.models.features import padded
from acqd.models.greybox.model import SMALL_TORQUE, GreyBox, magnitude
from acqd.robot.rigid_body import Turned, turned_by

if TYPE_CHECKING:
    from acqd.models.segments import Segment


@dataclass(slots=True)
class Scene:
    """Arrays over substeps [N = SUBSTEPS T] unless said otherwise; powers are at the mains, before the supply's lag."""

    step_s: float
    """Between rows."""
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
    """[T] W: the grey box's prediction of the rows, behind the lag."""
    signals: dict[str, Floats]
    """[N] 0/1 each; "tool", "brake"."""
    volts: Floats | None
    """[T] V."""
    temperature: Floats | None
    """[N, axes] degC."""
    memory: dict[str, Any] = field(default_factory=dict)
    """State that effects carry from one row to the next."""
    computed: dict[str, Any] = field(default_factory=dict)
    """Intermediate results that several effects share; they depend on the power per torque."""
    moved: dict[str, Any] = field(default_factory=dict)
    """Intermediate results that depend on motion only."""

    @property
    def rows(self) -> int:
        """T: rows of the segment."""
        return len(self.predicted)

    @property
    def axes(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    @property
    def turned(self) -> Turned:
        """[N, axes] cosine and sine of the angles, for every torque of this motion."""
        if "turned" not in self.moved:
            self.moved["turned"] = turned_by(self.q)
        known: Turned = self.moved["turned"]
        return known

    @property
    def direction(self) -> Floats:
        """[N, axes] sign of the speeds, smoothed around standstill as in the model."""
        return self.model.direction(self.qd)

    @property
    def substep_s(self) -> float:
        """Between substeps."""
        return self.step_s / SUBSTEPS

    def with_secant_slope(self, torque: Floats) -> Scene:
        """The scene whose power per torque is the secant slope dP/dtau [W/Nm] up to `torque` [N, axes] Nm more.

        Copper loss grows with the square of torque, so that 4 kg need more than twice the power of 2 kg. Columns at
        the secant slope, times the torque, are the exact power of that torque (secant linearisation).
        """
        loss = motor_loss(self.model, self.tau + torque) - motor_loss(self.model, self.tau)
        small = (np.abs(torque) < 1e-6) | (self.power_per_torque == 0.0)  # 0 while the brakes hold the arm
        secant = self.model.group("gain")[0] * self.qd + loss / np.where(small, 1.0, torque)
        return replace(self, power_per_torque=np.where(small, self.power_per_torque, secant), computed={})

    def unit_torque(self, joint: int) -> Scene:
        """The scene with 1 W/Nm at one joint and 0 elsewhere: an effect's power in it is its torque at that joint."""
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
) -> Scene:
    """A scene from angles [T + 2 RADIUS, axes] rad and rows [T] of signals, voltage and temperature."""
    step_s = model.step_s
    qf, qd, qdd = substep_motion(q, step_s)
    rows = len(q) - 2 * RADIUS
    switches = {name: substep_switch(values) for name, values in signals.items()}
    on = np.reshape(model.drives_on(switches), (-1, 1))
    turned = turned_by(qf)
    rigid, motor = (on * torque for torque in model.motor_torque(qf, qd, qdd, turned))
    gain, copper, conduction = (model.group(name) for name in ("gain", "copper", "conduction"))
    power_per_torque = on * (gain[0] * qd + 2 * copper * motor + conduction * motor / np.hypot(motor, SMALL_TORQUE))
    drives = gain[0] * (motor * qd).sum(axis=1) + motor_loss(model, motor).sum(axis=1)
    lag = Lag(float(model.group("lag")[0]), step_s)
    predicted = lag.means(drives) + float(model.group("standby")[0])
    for name, weight in zip(model.signals, model.group("signals"), strict=True):
        predicted = predicted + weight * signals.get(name, np.zeros(rows))
    return Scene(
        step_s, substep_times(start_s, rows, step_s), qf, qd, qdd, rigid, motor, power_per_torque, model, drives,
        predicted, switches, volts, None if temperature is None else np.repeat(temperature, SUBSTEPS, axis=0),
        moved={"turned": turned},
    )  # fmt: skip


def segment_scene(model: GreyBox, segment: Segment) -> Scene:
    """The scene of a segment; the arm rests before and after it unless its motion there is known."""
    s = segment
    angles = s.around(RADIUS)
    return make_scene(model, angles, s.signals, s.start_s, s.channels.get("Vrms"), s.channels.get("temperature"))


def scene_of(
    model: GreyBox, q: Floats, signals: dict[str, Floats], start_s: float, channels: dict[str, Floats]
) -> Scene:
    """The scene of a recording with angles [T, axes] rad; the arm rests before and after it."""
    return make_scene(model, padded(q, RADIUS), signals, start_s, channels.get("Vrms"), channels.get("temperature"))
