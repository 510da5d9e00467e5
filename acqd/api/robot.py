"""Robots: what a description says, and joint torques from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acqd.api.html import table
from acqd.errors import UserError
from acqd.robot.description import load_description, shipped_descriptions

if TYPE_CHECKING:
    from acqd.api.places import Place
    from acqd.arrays import Floats


class Robot:
    """A robot description: shipped, by name, or from a TOML file, by path.

    >>> robot = Robot("ur10e")
    >>> robot.axes, robot.joints[0]
    (6, 'shoulder_pan')
    >>> robot.torque(np.zeros((1, 6))).shape
    (1, 6)
    """

    def __init__(self, name: Place) -> None:
        """Raises UserError for an unknown name, InputError for a file that is no description."""
        self.source = str(name)
        self.description = load_description(self.source)

    @staticmethod
    def shipped() -> list[str]:
        """Names of the descriptions that come with acqd."""
        return shipped_descriptions()

    @property
    def name(self) -> str:
        """Identifier, such as `iiwa7_r800`."""
        return self.description.name

    @property
    def title(self) -> str:
        """Name for people."""
        return self.description.title

    @property
    def axes(self) -> int:
        """Number of joints."""
        return self.description.axes

    @property
    def joints(self) -> list[str]:
        """Names of the joints, from base to flange."""
        return [joint.name for joint in self.description.joint]

    @property
    def limits(self) -> Floats:
        """Position limits [2, axes], lower and upper, rad (m for prismatic joints)."""
        return np.array([self.description.lower, self.description.upper])

    @property
    def speed(self) -> Floats:
        """Speed limits [axes], rad/s (m/s)."""
        return self.description.speed

    def torque(self, q: Floats, qd: Floats | None = None, qdd: Floats | None = None) -> Floats:
        """Rigid-body joint torques [T, axes] Nm (N) of a motion: q [T, axes] rad, qd rad/s, qdd rad/s^2 (None: rest).

        Without friction, rotors and losses. Raises UserError for arrays of another shape.
        """
        from acqd.robot.inertia import inertial_parameters
        from acqd.robot.newton_euler import Chain, joint_torque

        angles = np.asarray(q, dtype=np.float64)
        moved = [np.zeros_like(angles) if x is None else np.asarray(x, dtype=np.float64) for x in (qd, qdd)]
        for name, values in zip(("q", "qd", "qdd"), (angles, *moved), strict=True):
            if values.shape != angles.shape or values.ndim != 2 or values.shape[1] != self.axes:
                raise UserError(f"{name} has the shape {values.shape}, expected [rows, {self.axes}] for {self.name}")
        return joint_torque(Chain.of(self.description), inertial_parameters(self.description), angles, *moved)

    def __repr__(self) -> str:
        return f"Robot({self.name!r})"

    def _repr_html_(self) -> str:
        """For notebooks: the joints with their limits."""
        rows = []
        for joint in self.description.joint:
            unit = "m" if joint.slides else "deg"
            limits = f"{joint.limits[0]:g} to {joint.limits[1]:g} {unit}"
            rows.append((joint.name, limits, f"{joint.speed:g} {unit}/s", ", ".join(joint.guessed) or "nothing"))
        return table(f"{self.name}: {self.title}", ("joint", "limits", "speed", "guessed"), rows)
