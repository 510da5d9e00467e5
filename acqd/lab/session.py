"""A session: one uninterrupted power stream over several executions on one plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.lab.cell import CLOCK, EFFECTS, MAINS, RECORDER, STANDBY, Cell
from acqd.lab.effects import make_effects
from acqd.lab.instruments.data_recorder import ControllerClock, Recorded, record
from acqd.lab.instruments.full_speed_plc import FullSpeedDaemon
from acqd.lab.instruments.mains import Mains, Metered
from acqd.lab.plant import Effect, Plant, Situation, Stretch
from acqd.lab.schedule import session_start_s
from acqd.metering import WindowBatch
from acqd.metering.block import Codes
from acqd.motion.controller import RATE, Controller, Motion, Step, Wait

_CHUNK_MS = 10_000  # length of the waveform pieces, which bounds memory


@dataclass(frozen=True, slots=True)
class RecordingTruth:
    """One execution as it really was."""

    number: int
    """In the campaign, from 1."""
    name: str
    start_s: float
    """True time since the start of the session."""
    seconds: float
    rows: int
    """Rows of the robot's log."""


@dataclass(slots=True)
class SessionTruth:
    """What really happened in a session."""

    start_utc_ns: int
    window_s: float
    recordings: list[RecordingTruth] = field(default_factory=list)
    power: Floats = field(default_factory=lambda: np.empty(0))
    """[windows] W: true mean."""
    clean_power: Floats = field(default_factory=lambda: np.empty(0))
    """[windows] W: true mean with all effects switched off."""
    metered: Floats = field(default_factory=lambda: np.empty(0))
    """[windows] W: P of the rows, NaN where unknown."""
    energy: dict[str, Any] = field(default_factory=dict)
    """Balance of the plant's energy ledger."""


def windows_within(start_s: float, seconds: float, window_s: float) -> slice:
    """Indices of the windows of a session that lie entirely within a recording."""
    first, last = start_s / window_s, (start_s + seconds) / window_s
    return slice(int(np.ceil(first - 1e-6)), int(np.floor(last + 1e-6)))


class Session:
    """Runs programs on the plant and meters its power; every batch of windows goes to `deliver`."""

    def __init__(
        self,
        cell: Cell,
        number: int,
        start_utc_ns: int,
        position: Floats,
        deliver: Callable[[WindowBatch], None],
        keep: Callable[[Codes], None] | None = None,
    ) -> None:
        """`position` [axes] (rad) is the arm's first position; `keep` receives the raw codes as well."""
        settings = cell.settings
        self._cell = cell
        self._number = number
        self._deliver = deliver
        self._keep = keep
        self._effects = make_effects(settings.effects, [settings.seed, cell.number, EFFECTS, number])
        for effect in self._effects:
            effect.work(60 * settings.worked_min)
        self._mains = Mains(settings.mains, cell.random(MAINS, number))
        self._daemon = FullSpeedDaemon(self._mains.form, settings.window_s, start_utc_ns)
        self._plant = self._make_plant(self._effects)
        self._clean_plant = self._make_plant([]) if self._effects else None  # the same noise, without the effects
        self._powers: list[Floats] = []
        self._clean_powers: list[Floats] = []
        self._metered: list[Floats] = []
        self._ms = 0
        self.controller = Controller(cell.robot, position)
        self.truth = SessionTruth(start_utc_ns, settings.window_s)

    def _make_plant(self, effects: list[Effect]) -> Plant:
        cell = self._cell
        noise = cell.random(STANDBY, self._number)
        settings = cell.settings
        return Plant(cell.true_arm, cell.parameters, effects, settings.start_degC, noise, settings.mains.voltage)

    @property
    def elapsed_s(self) -> float:
        """Simulated time since the start of the session."""
        return self._ms / RATE

    def pause(self, steps: list[Step], recording: int) -> None:
        """Run steps between recordings, metered but not logged; `recording` is the number of the next one."""
        self._play(self.controller.run(steps), recording, recorded=False)

    def record(self, program: list[Step], number: int, name: str, log: Path) -> None:
        """Execute a program as recording `number` and write the robot's log to `log`. Raises UserError."""
        self.record_motion(self.controller.run(program), number, name, log)

    def record_motion(self, motion: Motion, number: int, name: str, log: Path) -> None:
        """Like `record`, for a given motion."""
        for effect in self._effects:
            if effect.onset[0] == number and effect.onset[1] >= motion.seconds:
                problem = f"effect {effect.id}: at={effect.onset[1]:g}, but {name} lasts only {motion.seconds:.1f} s"
                raise UserError(problem)
        start_s = self.elapsed_s
        signals = self._play(motion, number, recorded=True)
        settings = self._cell.settings
        since_campaign_s = start_s + (self.truth.start_utc_ns - settings.start_utc_ns) * 1e-9
        recorder = settings.recorder.settings()
        random = self._cell.random(RECORDER, number)
        rows = record(log, self._cell.robot, signals, since_campaign_s, self._clock(number), recorder, random)
        self.truth.recordings.append(RecordingTruth(number, name, start_s, motion.seconds, rows))

    def finish(self) -> SessionTruth:
        """Stand still for two seconds, so that the last windows are complete, and return the truth."""
        last = max((recording.number for recording in self.truth.recordings), default=0)
        self.pause([Wait(2.0)], last + 1)
        self._daemon.close()
        truth = self.truth
        truth.power = self._window_means(self._powers)
        truth.clean_power = self._window_means(self._clean_powers) if self._clean_plant else truth.power
        truth.metered = np.concatenate(self._metered)
        truth.energy = self._plant.ledger.balance()
        return truth

    def _clock(self, recording: int) -> ControllerClock:
        clock = self._cell.settings.clock.clock(self._cell.settings.start_utc_ns)
        if self._cell.number:  # the clocks of a fleet have different errors
            random = self._cell.random(CLOCK)
            clock = ControllerClock(
                clock.offset_s + random.normal(0, 2), clock.drift_ppm + random.normal(0, 10), clock.origin_utc_ns
            )
        for effect in self._effects:
            clock = effect.clock(clock, recording, partial(session_start_s, self._cell.settings))
        return clock

    def _play(self, motion: Motion, recording: int, *, recorded: bool) -> Recorded:
        voltage = self._mains.voltage(self._ms, len(motion))
        stretch = Stretch(self.elapsed_s, recording, recorded)
        trace = self._plant.run(motion, voltage, stretch)
        self._powers.append(trace.power)
        if self._clean_plant:
            self._clean_powers.append(self._clean_plant.run(motion, voltage, stretch).power)
        fault = _sensor_fault(self._effects, trace.situation)
        for first in range(0, len(motion), _CHUNK_MS):
            part = slice(first, first + _CHUNK_MS)
            sensor = fault and Metered(fault.gain[part], fault.limit[part])
            self._meter(self._mains.waveform(trace.power[part], sensor))
        self._ms += len(motion)
        return trace.recorded

    def _meter(self, codes: Codes) -> None:
        if self._keep is not None:
            self._keep(codes)
        for batch in self._daemon.feed(codes):
            self._metered.append(batch.P[0])
            self._deliver(batch)

    def _window_means(self, powers: list[Floats]) -> Floats:
        """[windows] W: mean power per window, by the trapezoidal rule over the 1 kHz samples."""
        power = np.concatenate(powers)
        width = round(self.truth.window_s * RATE)
        integral = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2)])
        return np.asarray(np.diff(integral[::width]) / width)


def _sensor_fault(effects: list[Effect], situation: Situation) -> Metered | None:
    """All faults of the current sensor combined, None without a fault."""
    faults = [fault for effect in effects if (fault := effect.metered(situation)) is not None]
    if not faults:
        return None
    gain = np.prod([gain for gain, _ in faults], axis=0)
    return Metered(gain, np.min([limit for _, limit in faults], axis=0))
