"""Faults of the meter, the controller's clock or the robot's sensors; the robot itself is unchanged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.lab.effects.friction import only_axis
from acqd.lab.instruments.data_recorder import ControllerClock, Recorded
from acqd.lab.plant.situation import Effect, Situation


class MeterGain(Effect):
    """Gain error of the current transformer."""

    id = "meter_gain"
    summary = "the measured current is too large by a share"
    strength = ("relative", "of the current")
    defaults: ClassVar = {"relative": 0.02}
    limits: ClassVar = {"relative": (-0.9, 10)}

    def metered(self, situation: Situation) -> tuple[Floats, Floats]:
        """A gain other than 1 and no limit."""
        gain = 1.0 + self["relative"] * self.gate(situation)
        return gain, np.full(len(gain), np.inf)


class MeterSaturation(Effect):
    """The current channel saturates."""

    id = "meter_saturation"
    summary = "the measured current is clipped at this peak value"
    strength = ("limit_A", "A")
    defaults: ClassVar = {"limit_A": 1.45}
    limits: ClassVar = {"limit_A": (0.001, 1000)}

    def metered(self, situation: Situation) -> tuple[Floats, Floats]:
        """A gain of 1 and a limit."""
        active = self.gate(situation) > 0
        return np.ones(len(active)), np.where(active, self["limit_A"], np.inf)


class EncoderBias(Effect):
    """An axis was mastered wrongly: the logged angle differs from the true angle; the loop says `joint_zero`."""

    id = "encoder_bias"
    summary = "the logged angle of one axis has an offset"
    strength = ("angle_rad", "rad")
    defaults: ClassVar = {"angle_rad": 0.03, "axis": 2.0}
    limits: ClassVar = {"angle_rad": (-1, 1), "axis": (1, 100)}

    def logged(self, recorded: Recorded, situation: Situation) -> Recorded:
        """The log with a shifted angle."""
        axes = only_axis(self["axis"], recorded.q.shape[1])
        return replace(recorded, q=recorded.q + self["angle_rad"] * self.gate(situation)[:, None] * axes)


class TorqueBias(Effect):
    """The zero of a joint torque sensor has shifted."""

    id = "torque_bias"
    summary = "the logged torque of one axis has an offset"
    strength = ("torque_Nm", "Nm")
    defaults: ClassVar = {"torque_Nm": 3.0, "axis": 2.0}
    limits: ClassVar = {"axis": (1, 100)}

    def logged(self, recorded: Recorded, situation: Situation) -> Recorded:
        """The log with a shifted torque."""
        axes = only_axis(self["axis"], recorded.tau.shape[1])
        return replace(recorded, tau=recorded.tau + self["torque_Nm"] * self.gate(situation)[:, None] * axes)


class ClockOffset(Effect):
    """The controller's clock was set."""

    id = "clock_offset"
    summary = "the controller's clock jumps by this time"
    strength = ("seconds", "s")
    defaults: ClassVar = {"seconds": 0.2}

    whole_recordings = True

    def clock(self, clock: ControllerClock, recording: int, session_start_s: Callable[[int], float]) -> ControllerClock:
        """The clock, shifted from the onset's recording on."""
        shift = self["seconds"] * (recording >= self.onset[0])
        return replace(clock, offset_s=clock.offset_s + shift)


class ClockDrift(Effect):
    """The controller's clock runs faster than before."""

    id = "clock_drift"
    summary = "the controller's clock gains this much, from the start of the session that holds the onset"
    strength = ("ppm", "ppm")
    defaults: ClassVar = {"ppm": 30.0}
    limits: ClassVar = {"ppm": (-1000, 1000)}

    whole_recordings = True

    def clock(self, clock: ControllerClock, recording: int, session_start_s: Callable[[int], float]) -> ControllerClock:
        """The clock with a changed rate but no jump: drift counts from the start of the session with the onset."""
        onset_s = session_start_s(self.onset[0])
        if session_start_s(recording) < onset_s:
            return clock
        offset_s = clock.offset_s - self["ppm"] * 1e-6 * onset_s
        return replace(clock, offset_s=offset_s, drift_ppm=clock.drift_ppm + self["ppm"])
