"""Power of an arm as a sum of physical terms, each accessible by name.

    P = standby + signals + lag{ on [gain (rigid body + rotors + Coulomb + viscous) + copper + conduction] }

The motor torque is the sum of rigid-body, rotor and friction torque. Copper loss is proportional to its square, the
conduction loss of the inverters to its magnitude. Dry friction changes its sign within a speed that all joints share
(ADR 86). The supply is a first-order lag. `on` is the brake signal, where it was logged: closed brakes hold the arm,
and the drives carry nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.features import derivatives
from acqd.models.first_order import filtered
from acqd.models.greybox.parameters import Layout
from acqd.models.predictor import Predictor
from acqd.robot.newton_euler import Chain, joint_torque
from acqd.robot.rigid_body import Turned

SMALL_TORQUE = 0.5
"""Torque in Nm below which the magnitude of a torque is smoothed."""
TERMS = ("rigid_body", "rotor", "coulomb", "viscous", "copper", "conduction")


def magnitude(tau: Floats) -> Floats:
    """|tau| in Nm, smoothed around zero."""
    return np.asarray(np.sqrt(tau * tau + SMALL_TORQUE**2) - SMALL_TORQUE)


def lag_filter(lag_s: float, step_s: float) -> tuple[tuple[float, float], float]:
    """Coefficients b and a of a first-order lag (bilinear transform), as `filtered` takes them."""
    c = 2 * lag_s / step_s
    return (1 / (1 + c), 1 / (1 + c)), (1 - c) / (1 + c)


def lagged(values: Floats, lag_s: float, step_s: float) -> Floats:
    """`values` behind a first-order lag along the first axis, in steady state at the first row."""
    b, a = lag_filter(lag_s, step_s)
    return filtered(b, a, values, values[:1] * (1 - b[0]))[0]


@dataclass(slots=True)
class _State:
    before: float | None = None
    """W, sum of the undelayed terms one row ago."""
    lagged: float = 0.0
    """W, the same sum behind the lag."""


class GreyBox(Predictor):
    """The sum of terms above, with its parameters [p] in `values`."""

    radius = 1

    def __init__(
        self, chain: Chain, layout: Layout, values: Floats, step_s: float, usual_signals: Floats | None = None
    ) -> None:
        self.chain, self.layout, self.values = chain, layout, values
        self.axes, self.step_s, self.signals = layout.axes, step_s, layout.signals
        self._usual = np.zeros(len(layout.signals)) if usual_signals is None else usual_signals

    def usual_signals(self) -> Floats:
        """Medians of the training data."""
        return self._usual

    def group(self, name: str) -> Floats:
        """Values of a parameter group (see `Layout.place`)."""
        return self.values[self.layout.part(name)]

    def terms(self, q: Floats, signals: Floats) -> dict[str, Floats]:
        """Mains power [T] W of each term, of angles [T + 2, axes] and signals [T, k]; the sum is the prediction."""
        terms = {name: lagged(value, self._lag, self.step_s) for name, value in self._undelayed(q, signals).items()}
        terms["signals"] = signals @ self.group("signals")
        terms["standby"] = np.full(len(signals), self.group("standby")[0])
        return terms

    def run(self, q: Floats, signals: Floats) -> Floats:
        """The sum of all terms."""
        return np.sum(list(self.terms(q, signals).values()), axis=0)  # type: ignore[no-any-return]

    def start(self) -> _State:
        """The lag is in steady state at the first row."""
        return _State()

    def step(self, state: _State, window: Floats, signals: Floats) -> float:
        """One row of the terms, behind the lag."""
        now = float(sum(value[0] for value in self._undelayed(window, signals[None]).values()))
        if state.before is None:
            state.lagged = now
        else:
            b, a = lag_filter(self._lag, self.step_s)
            state.lagged = b[0] * now + b[1] * state.before - a * state.lagged
        state.before = now
        return state.lagged + float(signals @ self.group("signals")) + float(self.group("standby")[0])

    @property
    def _lag(self) -> float:
        return float(self.group("lag")[0])

    def motor_torque(self, q: Floats, qd: Floats, qdd: Floats, turned: Turned | None = None) -> tuple[Floats, Floats]:
        """Rigid-body torque and motor torque, both at the gear output [T, axes] Nm; `turned` as in `joint_torque`."""
        tau = self.rigid_torque(q, qd, qdd, turned)
        return tau, tau + self._beyond_links(qd, qdd)

    def _beyond_links(self, qd: Floats, qdd: Floats) -> Floats:
        """[T, axes] Nm of rotors and friction."""
        return np.asarray(
            self.group("rotor") * qdd + self.group("coulomb") * self.direction(qd) + self.group("viscous") * qd
        )

    def direction(self, qd: Floats) -> Floats:
        """Sign of speeds qd [rad/s], smoothed around standstill within the model's `sign_speed`."""
        return np.asarray(np.tanh(qd / self.group("sign_speed")[0]))

    def direction_slope(self, qd: Floats) -> Floats:
        """Derivative of the direction by the `sign_speed`, 1/(rad/s)."""
        sign, speed = self.direction(qd), self.group("sign_speed")[0]
        return np.asarray(-(1 - sign * sign) * qd / speed**2)

    def drives_on(self, signals: Mapping[str, Floats]) -> Floats | float:
        """Share [T] of each row in which the drives carry the arm; 1 for a model without a brake signal."""
        return signals["brake"] if "brake" in self.signals and "brake" in signals else 1.0

    def joint_terms(self, q: Floats, signals: Floats) -> dict[str, Floats]:
        """As `terms`, of the drives only and by joint [T, axes]; the rigid body as `gravity` and `inertia`.

        Gravity is the torque that holds the arm at rest; over all joints, its power is the change of the potential
        energy, and that of the rest of the rigid-body torque the change of the kinetic energy of the links.
        """
        here, (qd, _) = q[1:-1], derivatives(q, self.step_s)
        powers = self._of_joints(q, signals)
        still = np.zeros_like(here)
        holding = self.rigid_torque(here, still, still)
        on = self._on(signals)[:, None]
        powers["gravity"] = on * self.group("gain")[0] * holding * qd
        powers["inertia"] = powers.pop("rigid_body") - powers["gravity"]
        return {name: lagged(value, self._lag, self.step_s) for name, value in powers.items()}

    def _undelayed(self, q: Floats, signals: Floats) -> dict[str, Floats]:
        return {name: power.sum(axis=1) for name, power in self._of_joints(q, signals).items()}

    def _of_joints(self, q: Floats, signals: Floats) -> dict[str, Floats]:
        """[T, axes] W of every term before the lag."""
        on = self._on(signals)[:, None]
        qd, qdd = derivatives(q, self.step_s)
        return {name: on * power for name, power in self._powers(self.rigid_torque(q[1:-1], qd, qdd), qd, qdd).items()}

    def rigid_torque(self, q: Floats, qd: Floats, qdd: Floats, turned: Turned | None = None) -> Floats:
        """[T, axes] Nm of the links at the gear output."""
        return joint_torque(self.chain, self.group("inertial"), q, qd, qdd, turned=turned)

    def drive_power(self, tau: Floats, qd: Floats, qdd: Floats) -> Floats:
        """[T] W of the drives with open brakes, before the lag, for rigid-body torques [T, axes], in any order."""
        return np.asarray(np.sum(list(self._powers(tau, qd, qdd).values()), axis=0).sum(axis=1))

    def _powers(self, tau: Floats, qd: Floats, qdd: Floats) -> dict[str, Floats]:
        """[T, axes] W of every term, as if the brakes were open and the supply without lag."""
        motor = tau + self._beyond_links(qd, qdd)
        gain = self.group("gain")[0]
        return {
            "rigid_body": gain * tau * qd,
            "rotor": gain * self.group("rotor") * qdd * qd,
            "coulomb": gain * self.group("coulomb") * self.direction(qd) * qd,
            "viscous": gain * self.group("viscous") * qd * qd,
            "copper": self.group("copper") * motor * motor,
            "conduction": self.group("conduction") * magnitude(motor),
        }

    def _on(self, signals: Floats) -> Floats:
        """[T] share of every row in which the drives carry the arm."""
        return np.ones(len(signals)) * self.drives_on(dict(zip(self.signals, signals.T, strict=True)))
