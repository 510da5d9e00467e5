"""Power of an arm as a sum of physical terms, each of them addressable.

    P = standby + signals + lag{ on [gain (rigid body + rotors + Coulomb + viscous) + copper + conduction] }

Motor torque is that of the rigid body, the rotors and friction together; copper loss goes with its square, the
inverters' conduction loss with its magnitude. The lag is the supply's, first order. `on` is the brake signal, where
there is one: while the brakes are closed, they hold the arm and the drives carry nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.models.features import derivatives
from acqd.models.greybox.parameters import Layout
from acqd.models.predictor import Predictor
from acqd.robot.newton_euler import Chain, joint_torque

SIGN_SPEED = 0.02
"""rad/s within which dry friction turns round."""
SMALL_TORQUE = 0.5  # Nm within which the magnitude of a torque is rounded off
TERMS = ("rigid_body", "rotor", "coulomb", "viscous", "copper", "conduction")


def direction(qd: Floats) -> Floats:
    """Sign of the speed, smooth through standstill."""
    return np.asarray(np.tanh(qd / SIGN_SPEED))


def magnitude(tau: Floats) -> Floats:
    """|tau|, smooth through zero."""
    return np.asarray(np.sqrt(tau * tau + SMALL_TORQUE**2) - SMALL_TORQUE)


def lag_filter(lag_s: float, step_s: float) -> tuple[Floats, Floats]:
    """First-order lag by the trapezoidal rule: b, a."""
    c = 2 * lag_s / step_s
    return np.array([1.0, 1.0]) / (1 + c), np.array([1.0, (1 - c) / (1 + c)])


def lagged(values: Floats, lag_s: float, step_s: float) -> Floats:
    """Behind the lag, along the first axis, from rest at the first row."""
    b, a = lag_filter(lag_s, step_s)
    out, _ = lfilter(b, a, values, axis=0, zi=values[:1] * (1 - b[0]))
    return np.asarray(out)


@dataclass(slots=True)
class _State:
    before: float | None = None
    """Sum of the terms one row ago."""
    lagged: float = 0.0


class GreyBox(Predictor):
    """See the module."""

    radius = 1

    def __init__(
        self, chain: Chain, layout: Layout, values: Floats, step_s: float, usual_signals: Floats | None = None
    ) -> None:
        self.chain, self.layout, self.values = chain, layout, values
        self.axes, self.step_s, self.signals = layout.axes, step_s, layout.signals
        self._usual = np.zeros(len(layout.signals)) if usual_signals is None else usual_signals

    def usual_signals(self) -> Floats:
        """See Predictor."""
        return self._usual

    def group(self, name: str) -> Floats:
        """Values of a parameter group."""
        return self.values[self.layout.place(name)]

    def terms(self, q: Floats, signals: Floats) -> dict[str, Floats]:
        """[T] W of each term at the mains, for angles [T + 2, axes]; they add up to the prediction."""
        found = {name: lagged(value, self._lag, self.step_s) for name, value in self._undelayed(q, signals).items()}
        found["signals"] = signals @ self.group("signals")
        found["standby"] = np.full(len(signals), self.group("standby")[0])
        return found

    def run(self, q: Floats, signals: Floats) -> Floats:
        """See Predictor."""
        return np.sum(list(self.terms(q, signals).values()), axis=0)  # type: ignore[no-any-return]

    def start(self) -> _State:
        """See Predictor."""
        return _State()

    def step(self, state: _State, window: Floats, signals: Floats) -> float:
        """See Predictor."""
        now = float(sum(value[0] for value in self._undelayed(window, signals[None]).values()))
        if state.before is None:
            state.lagged = now
        else:
            b, a = lag_filter(self._lag, self.step_s)
            state.lagged = b[0] * now + b[1] * state.before - a[1] * state.lagged
        state.before = now
        return state.lagged + float(signals @ self.group("signals")) + float(self.group("standby")[0])

    @property
    def _lag(self) -> float:
        return float(self.group("lag")[0])

    def motor_torque(self, q: Floats, qd: Floats, qdd: Floats) -> tuple[Floats, Floats]:
        """Of the rigid body, and at the motors (both at the output, [T, axes] Nm)."""
        tau = joint_torque(self.chain, self.group("inertial"), q, qd, qdd)
        friction = self.group("coulomb") * direction(qd) + self.group("viscous") * qd
        return tau, tau + self.group("rotor") * qdd + friction

    def drives_on(self, signals: Mapping[str, Floats]) -> Floats | float:
        """[T] share of each row in which the drives carry the arm; 1 for a model that was fitted without brakes."""
        return signals["brake"] if "brake" in self.signals and "brake" in signals else 1.0

    def _undelayed(self, q: Floats, signals: Floats) -> dict[str, Floats]:
        qd, qdd = derivatives(q, self.step_s)
        tau, motor = self.motor_torque(q[1:-1], qd, qdd)
        gain = self.group("gain")[0]
        on = self.drives_on(dict(zip(self.signals, signals.T, strict=True)))
        found = {
            "rigid_body": gain * (tau * qd).sum(axis=1),
            "rotor": gain * (qdd * qd) @ self.group("rotor"),
            "coulomb": gain * (direction(qd) * qd) @ self.group("coulomb"),
            "viscous": gain * (qd * qd) @ self.group("viscous"),
            "copper": (motor * motor) @ self.group("copper"),
            "conduction": magnitude(motor) @ self.group("conduction"),
        }
        return {name: on * power for name, power in found.items()}
