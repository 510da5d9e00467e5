"""What an effect sees of the plant while it works, and where it may intervene."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.lab.instruments.data_recorder import ControllerClock, Recorded
from acqd.lab.motion.controller import RATE, Motion
from acqd.lab.plant.parameters import PlantParameters
from acqd.robot.arm import Arm


@dataclass(frozen=True, slots=True)
class Stretch:
    """Where in a campaign a stretch of motion lies."""

    start_s: float = 0.0
    """Since the session's begin."""
    recording: int = 1
    """Number of the recording that this belongs to or comes before, from 1, over the whole campaign."""
    recorded: bool = True
    """Whether the robot's recorder is running."""


@dataclass(slots=True)
class Situation:
    """One stretch of motion; the quantities below `voltage` fill up as the plant computes them."""

    stretch: Stretch
    motion: Motion
    arm: Arm
    """The robot as it really is, without payload."""
    parameters: PlantParameters
    voltage: Floats
    """[T] Vrms of the mains."""
    nominal_V: float
    """What the mains should have."""
    tau_rigid: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] Nm: rigid body with payload."""
    tau_friction: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] Nm."""
    current: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] A."""
    joint_power: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] W into the motors: shaft and copper."""
    dc_power: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W from the DC link: drives and electronics, after storage and chopper."""
    mains_power: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W demanded from the mains before effects on the supply."""

    @property
    def t(self) -> Floats:
        """[T] s since the session's begin."""
        return self.stretch.start_s + np.arange(len(self.motion)) / RATE


class Effect(ABC):
    """A physical effect that the undisturbed plant does not have. Additive: every hook returns what is added.

    Subclasses set `id`, `about`, `strength` and `defaults`, and override the hooks they need.
    Adding an effect is one class in one file of `acqd.lab.effects`.
    """

    id: ClassVar[str]
    summary: ClassVar[str]
    strength: ClassVar[tuple[str, str]]
    """Name and unit of the parameter that says how strong it is."""
    defaults: ClassVar[Mapping[str, float]]
    """Every parameter with its default, the strength first."""
    limits: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Least and greatest value of the parameters that cannot have any."""
    whole_recordings: ClassVar[bool] = False
    """It begins with a recording, never within one."""

    def __init__(self, values: Mapping[str, float], onset: tuple[int, float], random: np.random.Generator) -> None:
        """`onset`: recording number (from 1) and seconds within it."""
        self.values = {**self.defaults, **values}
        self.onset = onset
        self.random = random
        self.begin()

    def begin(self) -> None:
        """Set up whatever state the effect carries from stretch to stretch of one session."""
        return

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def gate(self, situation: Situation) -> Floats:
        """[T] 1 where the effect acts, 0 before its onset."""
        number, seconds = self.onset
        samples = len(situation.motion)
        stretch = situation.stretch
        if stretch.recording != number or (not stretch.recorded and seconds <= 0):
            return np.full(samples, float(stretch.recording >= number))
        if not stretch.recorded:  # on the way to the recording in which it begins
            return np.zeros(samples)
        return (np.arange(samples) / RATE >= seconds).astype(float)

    def payload(self, situation: Situation) -> Floats | None:
        """[T] kg at the flange."""
        return None

    def external_torque(self, situation: Situation) -> Floats | None:
        """[T, axes] Nm on the arm from outside: the torque sensors see it too."""
        return None

    def torque(self, situation: Situation) -> Floats | None:
        """[T, axes] Nm that the motor must supply on its side of the torque sensor."""
        return None

    def dc_load(self, situation: Situation) -> Floats | None:
        """[T] W from the DC link."""
        return None

    def mains_load(self, situation: Situation) -> Floats | None:
        """[T] W from the mains."""
        return None

    def metered(self, situation: Situation) -> tuple[Floats, Floats] | None:
        """[T] factor on the measured current, and [T] current (A) at which the sensor saturates."""
        return None

    def logged(self, recorded: Recorded, situation: Situation) -> Recorded:
        """What the robot's log shows."""
        return recorded

    def clock(self, clock: ControllerClock, recording: int, begin_s: Callable[[int], float]) -> ControllerClock:
        """The controller's clock during a recording; `begin_s` tells when a recording's session begins."""
        return clock
