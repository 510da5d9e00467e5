"""Nothing wrong with the robot: the meter, its clock or the log is."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from acqd.lab.effects.friction import only_axis
from acqd.lab.plant.situation import Effect, Situation
from acqd.lab.recorder import ControllerClock, Recorded
from acqd.robot.description import Floats


class MeterGain(Effect):
    """The current transformer reads too much."""

    id = "meter_gain"
    about = "measured current is off by a share"
    strength = ("relative", "of the current")
    defaults: ClassVar = {"relative": 0.02}

    def metered(self, situation: Situation) -> tuple[Floats, float]:
        """Factor on the current."""
        return 1.0 + self["relative"] * self.gate(situation), np.inf


class MeterSaturation(Effect):
    """The current channel clips."""

    id = "meter_saturation"
    about = "measured current is clipped at this peak value"
    strength = ("limit_A", "A")
    defaults: ClassVar = {"limit_A": 1.45}

    def metered(self, situation: Situation) -> tuple[Floats, float]:
        """Limit on the current."""
        active = self.gate(situation).any()
        return np.ones(len(situation.motion)), self["limit_A"] if active else np.inf


class EncoderBias(Effect):
    """An axis was mastered wrongly: the log shows an angle that the arm does not have."""

    id = "encoder_bias"
    about = "logged angle of one axis is off"
    strength = ("angle_rad", "rad")
    defaults: ClassVar = {"angle_rad": 0.03, "axis": 2.0}

    def logged(self, recorded: Recorded, situation: Situation) -> Recorded:
        """Shift the angle."""
        axes = only_axis(self["axis"], recorded.q.shape[1])
        return replace(recorded, q=recorded.q + self["angle_rad"] * self.gate(situation)[:, None] * axes)


class TorqueBias(Effect):
    """A joint torque sensor has lost its zero."""

    id = "torque_bias"
    about = "logged torque of one axis is off"
    strength = ("torque_Nm", "Nm")
    defaults: ClassVar = {"torque_Nm": 3.0, "axis": 2.0}

    def logged(self, recorded: Recorded, situation: Situation) -> Recorded:
        """Shift the torque."""
        axes = only_axis(self["axis"], recorded.tau.shape[1])
        return replace(recorded, tau=recorded.tau + self["torque_Nm"] * self.gate(situation)[:, None] * axes)


class ClockOffset(Effect):
    """Somebody set the controller's clock."""

    id = "clock_offset"
    about = "the controller's clock jumps by this much"
    strength = ("seconds", "s")
    defaults: ClassVar = {"seconds": 0.2}

    def clock(self, clock: ControllerClock, recording: int) -> ControllerClock:
        """From the onset's recording on."""
        shift = self["seconds"] * (recording >= self.onset[0])
        return replace(clock, offset_s=clock.offset_s + shift)


class ClockDrift(Effect):
    """The controller's clock runs faster than before."""

    id = "clock_drift"
    about = "the controller's clock gains this much"
    strength = ("ppm", "ppm")
    defaults: ClassVar = {"ppm": 30.0}

    def clock(self, clock: ControllerClock, recording: int) -> ControllerClock:
        """From the onset's recording on."""
        return replace(clock, drift_ppm=clock.drift_ppm + self["ppm"] * (recording >= self.onset[0]))
