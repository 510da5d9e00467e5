"""Parameters of a grey box: names, units, bounds and prior."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.robot.description import USUAL_MASS_DEVIATION, RobotDescription

INERTIAL = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_INERTIAL_UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
_PER_JOINT = {
    "rotor": "kg m^2",
    "coulomb": "Nm",
    "viscous": "Nm s/rad",
    "copper": "W/Nm^2",
    "conduction": "W/Nm",
}
SLIDING_UNITS = {
    "kg m^2": "kg",
    "Nm": "N",
    "Nm s/rad": "N s/m",
    "W/Nm^2": "W/N^2",
    "W/Nm": "W/N",
}
"""Unit of the same parameter of a prismatic joint."""
_MASS_SPREAD = 1.25
"""Relative deviation of a mass per `mass_deviation`: published parameter sets of one robot differ by 0.25."""
_COM_SPREAD_M = 0.15
"""Deviation of a centre of mass per `mass_deviation`: 3 cm between published sets."""
_GAIN, _GAIN_SPREAD = 1.05, 0.05  # mains power per joint power; logged torques determine it much better
_GUESSED_GAIN_SPREAD = 0.25
"""Of drives that nobody has described: gears lose 5 to 40 % of the power."""
_SIGN_SPEED = 0.01
"""rad/s within which friction changes its sign, and the prior deviation: a measured UR10e has 0.013."""
SIGN_SPEEDS = (0.002, 0.05)
"""Bounds: below, a row of 40 ms holds no slower motion; above, the friction would be viscous."""
_COPPER_SPREAD, _GUESSED_COPPER_SPREAD = 2.0, 10.0
"""Relative deviation of a copper loss; a guessed motor may be three times weaker, which is nine times the loss."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Positions of the parameters in the flat vector [p]. All powers are at the mains."""

    axes: int
    signals: tuple[str, ...]
    sliding: tuple[int, ...] = ()
    """Numbers of the prismatic joints, from 0: their efforts are in N, their positions in m."""

    def part(self, group: str) -> slice:
        """Slice of a group.

        Groups: inertial, rotor, coulomb, viscous, copper, conduction, signals, standby, gain, lag, sign_speed.
        """
        first = 0
        for name, size in self._sizes().items():
            if name == group:
                return slice(first, first + size)
            first += size
        raise KeyError(group)

    def _sizes(self) -> dict[str, int]:
        sizes = {"inertial": 10 * self.axes} | dict.fromkeys(_PER_JOINT, self.axes)
        return sizes | {"signals": len(self.signals), "standby": 1, "gain": 1, "lag": 1, "sign_speed": 1}

    @property
    def size(self) -> int:
        """Number of parameters."""
        return sum(self._sizes().values())

    def names(self) -> list[tuple[str, str]]:
        """Name and unit of each parameter."""
        names = [
            (f"{name}.link{k + 1}", unit)
            for k in range(self.axes)
            for name, unit in zip(INERTIAL, _INERTIAL_UNITS, strict=True)
        ]
        names += [
            (f"{name}.joint{k + 1}", SLIDING_UNITS[unit] if k in self.sliding else unit)
            for name, unit in _PER_JOINT.items()
            for k in range(self.axes)
        ]
        names += [(f"signal.{name}", "W") for name in self.signals]
        return [
            *names,
            ("standby", "W"),
            ("gain", "-"),
            ("lag", "s"),
            ("sign_speed", "m/s" if len(self.sliding) == self.axes else "rad/s"),
        ]

    def lowest(self) -> Floats:
        """Lower bounds [p]."""
        low = np.full(self.size, -np.inf)
        for group in _PER_JOINT:
            low[self.part(group)] = 0.0
        low[self.part("inertial")][::10] = 0.0
        low[self.part("gain")], low[self.part("lag")] = 0.5, 0.0
        low[self.part("sign_speed")] = SIGN_SPEEDS[0]
        return low

    def highest(self, step_s: float) -> Floats:
        """Upper bounds [p], for rows `step_s` apart."""
        high = np.full(self.size, np.inf)
        high[self.part("lag")], high[self.part("sign_speed")] = 2.0 * step_s, SIGN_SPEEDS[1]
        return high


@dataclass(frozen=True, slots=True)
class Prior:
    """Normal prior, independent unless `precision` is known. It holds the parameters that the data do not determine."""

    mean: Floats
    """[p]."""
    deviation: Floats
    """[p], infinite without prior knowledge; of no account with `precision`."""
    precision: Floats | None = None
    """[p, p] inverse covariance; None: diagonal, from the deviations."""

    def precision_matrix(self) -> Floats:
        """[p, p] inverse covariance."""
        return np.diag(self.deviation**-2.0) if self.precision is None else self.precision.copy()


def prior(layout: Layout, robot: RobotDescription, inertial: Floats, standby_W: float, step_s: float) -> Prior:
    """Prior from the robot description, its inertial parameters [10 axes] and a rough standby power.

    Parameters that a description does not give get a wide deviation.
    """
    mean, deviation = np.zeros(layout.size), np.full(layout.size, np.inf)
    mean[layout.part("inertial")] = inertial
    deviation[layout.part("inertial")] = inertial_spread(inertial, robot.mass_deviation)
    drives = [joint.drive for joint in robot.joint]
    rotor = np.array([drive.rotor_inertia_kgm2 for drive in drives])
    mean[layout.part("rotor")], deviation[layout.part("rotor")] = rotor, 0.5 * rotor + 0.01
    constant = np.array([drive.effort_per_ampere for drive in drives])
    copper = np.array([drive.resistance_Ohm for drive in drives]) / constant**2
    guessed = np.array([joint.guesses_drive for joint in robot.joint])
    mean[layout.part("copper")] = copper
    deviation[layout.part("copper")] = np.where(guessed, _GUESSED_COPPER_SPREAD, _COPPER_SPREAD) * copper
    torque = robot.effort
    for group in ("coulomb", "viscous"):
        mean[layout.part(group)] = [getattr(joint.friction, group, 0.0) for joint in robot.joint]
    deviation[layout.part("coulomb")] = 0.3 * torque
    deviation[layout.part("viscous")] = 0.5 * torque
    deviation[layout.part("conduction")] = 20.0 / torque
    deviation[layout.part("signals")] = 50.0
    mean[layout.part("standby")], deviation[layout.part("standby")] = standby_W, 100.0
    mean[layout.part("gain")] = _GAIN
    deviation[layout.part("gain")] = _GUESSED_GAIN_SPREAD if guessed.any() else _GAIN_SPREAD
    mean[layout.part("lag")], deviation[layout.part("lag")] = 0.015, step_s
    mean[layout.part("sign_speed")] = deviation[layout.part("sign_speed")] = _SIGN_SPEED
    return Prior(mean, deviation)


def inertial_spread(inertial: Floats, mass_deviation: float = USUAL_MASS_DEVIATION) -> Floats:
    """[10 axes] standard deviation of true inertial parameters about those of a description [10 axes]."""
    mass, com_m = inertial[::10], _COM_SPREAD_M * mass_deviation
    spread = _MASS_SPREAD * mass_deviation * np.abs(inertial).reshape(-1, 10)
    spread[:, 1:4] += com_m * mass[:, None]
    spread[:, 4:] += (com_m**2 + 0.1 * com_m) * mass[:, None]
    return np.asarray(spread.ravel() + 1e-6)


def table(layout: Layout, values: Floats, covariance: Floats) -> list[dict[str, Any]]:
    """Entries of bundle.json: name, value, unit and 95 % confidence interval of each parameter."""
    half = 1.96 * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return [
        {"name": name, "value": float(value), "unit": unit, "ci95": [float(value - width), float(value + width)]}
        for (name, unit), value, width in zip(layout.names(), values, half, strict=True)
    ]
