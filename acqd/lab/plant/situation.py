"""The interface of effects: the state of the plant that they see, and the hooks at which they act."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.lab.instruments.data_recorder import ControllerClock, Recorded
from acqd.lab.plant.parameters import PlantParameters
from acqd.motion.controller import RATE, Motion
from acqd.robot.arm import Arm


@dataclass(frozen=True, slots=True)
class Stretch:
    """Position of a stretch of motion within a campaign."""

    start_s: float = 0.0
    """Since the start of the session."""
    recording: int = 1
    """Number, from 1, of the recording that the stretch belongs to or precedes."""
    recorded: bool = True
    """Whether the robot's recorder is running."""


@dataclass(slots=True)
class Situation:
    """One stretch of motion. The plant fills in the fields from `tau_rigid` on, in this order."""

    stretch: Stretch
    motion: Motion
    arm: Arm
    """The robot as it really is, without payload."""
    parameters: PlantParameters
    voltage: Floats
    """[T] Vrms of the mains."""
    nominal_V: float
    """Nominal Vrms of the mains."""
    tau_rigid: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] Nm of the rigid body with payload."""
    tau_friction: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] Nm."""
    current: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] A of the motors."""
    joint_power: Floats = field(default_factory=lambda: np.empty(0))
    """[T, axes] W into the motors: shaft power and copper loss."""
    dc_power: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W that drives and electronics draw from the supply, after capacitor and chopper."""
    mains_power: Floats = field(default_factory=lambda: np.empty(0))
    """[T] W demanded from the mains, without effects on the mains side."""

    @property
    def t(self) -> Floats:
        """[T] s since the start of the session."""
        return self.stretch.start_s + np.arange(len(self.motion)) / RATE


class Effect(ABC):
    """A physical effect that the undisturbed plant does not have. Every hook returns what the effect adds.

    A subclass sets `id`, `summary`, `strength` and `defaults`, and overrides the hooks that it needs.
    """

    id: ClassVar[str]
    summary: ClassVar[str]
    """One sentence for `acqd lab effects`."""
    strength: ClassVar[tuple[str, str]]
    """Name and unit of the parameter that scales the effect."""
    defaults: ClassVar[Mapping[str, float]]
    """Default values of all parameters, the strength first."""
    limits: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Least and greatest values; +-1e6 for other parameters."""
    whole_recordings: ClassVar[bool] = False
    """Whether the effect can only start together with a recording."""

    def __init__(self, values: Mapping[str, float], onset: tuple[int, float], random: np.random.Generator) -> None:
        """`onset` is a recording number (from 1) and the seconds within it."""
        self.values = {**self.defaults, **values}
        self.onset = onset
        self.random = random
        self.begin()

    def begin(self) -> None:
        """Set up the state that the effect carries from stretch to stretch of a session."""
        return

    def work(self, seconds: float) -> None:
        """The robot has worked before the session."""
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
        if not stretch.recorded:  # on the way to the recording of the onset
            return np.zeros(samples)
        return (np.arange(samples) / RATE >= seconds).astype(float)

    def payload(self, situation: Situation) -> Floats | None:
        """Additional mass at the flange, [T] kg."""
        return None

    def external_torque(self, situation: Situation) -> Floats | None:
        """Motor torque against external forces, [T, axes] Nm; the torque sensors measure it."""
        return None

    def torque(self, situation: Situation) -> Floats | None:
        """Motor torque on the motor side of the torque sensor, [T, axes] Nm; the sensors do not measure it."""
        return None

    def dc_load(self, situation: Situation) -> Floats | None:
        """Additional power from the DC link, [T] W."""
        return None

    def mains_load(self, situation: Situation) -> Floats | None:
        """Additional power from the mains, [T] W."""
        return None

    def metered(self, situation: Situation) -> tuple[Floats, Floats] | None:
        """Gain of the current sensor [T], and the current [T] (A) at which it saturates."""
        return None

    def logged(self, recorded: Recorded, situation: Situation) -> Recorded:
        """The signals as the robot's log shows them."""
        return recorded

    def clock(self, clock: ControllerClock, recording: int, session_start_s: Callable[[int], float]) -> ControllerClock:
        """The controller's clock during a recording.

        `session_start_s` gives the start of a recording's session, in s since the start of the campaign.
        """
        return clock
