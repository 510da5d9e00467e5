"""Drives and supply: motor torques to mains power."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from tools.studies.foreign.generator.arm import Arm, Floats
from tools.studies.foreign.generator.motion import STEP_S


@dataclass(frozen=True, slots=True)
class Supply:
    """One DC link with a brake chopper behind a rectifier, and a cabinet next to it."""

    control_W: float
    """Controller and drive electronics at the DC link."""
    switching: Floats
    """[n] W/A in the inverters."""
    iron: Floats
    """[n] W at (1 rad/s)^1.5."""
    rectifier: tuple[float, float, float]
    """Loss in W at no load, per W, and per W^2."""
    lowest_W: float
    """The chopper burns whatever would lower the link's power below this."""
    cabinet_W: float
    """Fans and lamps on the same meter."""
    lag_s: float
    pure_delay: bool
    """The lag is a pure delay, else first-order."""

    def joint_power(self, arm: Arm, tau: Floats, qd: Floats) -> Floats:
        """[T] W of the motors and inverters for motor torques tau [T, n] Nm at the gears' output."""
        current = tau / arm.torque_per_ampere
        power = tau * qd + arm.resistance * current**2
        power += self.switching * np.sqrt(current**2 + 0.01) + self.iron * np.abs(qd) ** 1.5
        return np.asarray(power.sum(axis=1))

    def mains(self, link: Floats) -> Floats:
        """[T] W at the mains for the DC link's power [T] W, without lag."""
        idle, linear, square = self.rectifier
        link = np.maximum(link, self.lowest_W)
        return np.asarray(link + idle + linear * link + square * link**2 + self.cabinet_W)

    def marginal(self, link_W: float) -> float:
        """W at the mains per W at the link."""
        return 1 + self.rectifier[1] + 2 * self.rectifier[2] * link_W

    def lagged(self, power: Floats) -> Floats:
        """Power [T] W behind the lag."""
        if self.pure_delay:
            rows = np.arange(len(power))
            return np.asarray(np.interp(rows - self.lag_s / STEP_S, rows, power))
        keep = float(np.exp(-STEP_S / self.lag_s))
        late, _ = lfilter([1 - keep], [1.0, -keep], power, zi=power[:1] * keep)
        return np.asarray(late)


def drawn(arm: Arm, random: np.random.Generator) -> Supply:
    """Supply of one plant."""
    n = arm.joints
    return Supply(
        control_W=float(arm.torque.max() * random.uniform(0.35, 0.55)),
        switching=random.uniform(0.3, 0.9, n),
        iron=0.01 * arm.torque * random.uniform(0.5, 1.5, n),
        rectifier=(float(random.uniform(4, 9)), float(random.uniform(0.03, 0.07)), float(random.uniform(0.4e-4, 1e-4))),
        lowest_W=float(random.uniform(0, 5)),
        cabinet_W=float(random.uniform(20, 45)),
        lag_s=float(random.uniform(0.008, 0.035)),
        pure_delay=bool(random.random() < 0.4),
    )
