"""Loads other than the drives: standby, fans, grippers, process equipment."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.lab.effects.brakes import seconds_since
from acqd.lab.effects.load import Bursts
from acqd.lab.plant.situation import Effect, Situation


class OffsetShift(Effect):
    """Another device was connected: standby power rises permanently."""

    id = "offset_shift"
    summary = "an additional constant load (negative: one that was removed)"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 8.0}
    limits: ClassVar = {"power_W": (-50, 1e5)}

    def mains_load(self, situation: Situation) -> Floats:
        """Constant power from the onset on, [T] W."""
        return self["power_W"] * self.gate(situation)


class Thermostat(Effect):
    """A fan or cabinet heater that is switched by temperature, with a period unrelated to the motion."""

    id = "thermostat"
    summary = "a load that switches on and off periodically (period_s, duty), unrelated to the motion"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 14.0, "period_s": 130.0, "duty": 0.45}
    limits: ClassVar = {"period_s": (1, 1e5), "duty": (0.02, 0.98)}

    def begin(self) -> None:
        """Draw the first switching time."""
        self._switches = [-self.random.uniform(0, self["period_s"])]  # s: on, off, on ...

    def mains_load(self, situation: Situation) -> Floats:
        """Power while switched on, [T] W; periods scatter by 3 %."""
        t = situation.t
        while self._switches[-1] <= t[-1]:
            on = len(self._switches) % 2 == 1
            share = self["duty"] if on else 1 - self["duty"]
            self._switches.append(self._switches[-1] + share * self["period_s"] * self.random.normal(1, 0.03))
        number = np.searchsorted(self._switches, t, side="right")
        return self["power_W"] * (number % 2) * self.gate(situation)


class ToolActuation(Effect):
    """An electric gripper: a power pulse when it closes or opens, holding power while it is closed."""

    id = "tool_actuation"
    summary = "gripper: holding power while the tool is on, and a pulse of pulse_W for pulse_s at each switching"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 12.0, "pulse_W": 40.0, "pulse_s": 0.3}
    limits: ClassVar = {"pulse_s": (0.001, 60)}

    def begin(self) -> None:
        """No switching is remembered."""
        self._was_on: bool | None = None
        self._since_s = np.inf  # since the last switching

    def dc_load(self, situation: Situation) -> Floats:
        """Holding power and switching pulses, [T] W."""
        tool = situation.motion.tool_on
        before = tool[0] if self._was_on is None else self._was_on
        switched = tool != np.concatenate([[before], tool[:-1]])
        self._was_on = bool(tool[-1])
        since_s = seconds_since(switched, self._since_s)
        self._since_s = float(since_s[-1])
        return (self["power_W"] * tool + self["pulse_W"] * (since_s < self["pulse_s"])) * self.gate(situation)


class ProcessLoad(Effect):
    """A screwdriver, dispenser or welder on the same supply."""

    id = "process_load"
    summary = "equipment that works in program phases named process or screw, else in bursts of a few seconds"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 18.0}

    def begin(self) -> None:
        """Set up bursts of 3 to 8 s."""
        self._bursts = Bursts(self.random, (3.0, 8.0), 15.0)

    def mains_load(self, situation: Situation) -> Floats:
        """Power of the equipment while it works, [T] W."""
        motion = situation.motion
        working = [k for k, name in enumerate(motion.phase) if name in ("process", "screw")]
        if working:
            active = np.isin(motion.phase_number, working).astype(float)
        else:
            active = self._bursts.at(situation.t) * situation.stretch.recorded
        return self["power_W"] * active * self.gate(situation)
