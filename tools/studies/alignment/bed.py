"""Campaigns of the virtual laboratory, played once and metered behind any supply.

Playing a campaign costs most. The demand on the supply is therefore kept at 1 kHz and metered again for every supply.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.dataset.power import PowerStream
from acqd.lab.campaign.folders import Folders
from acqd.lab.campaign.programs import Programs
from acqd.lab.campaign.trajectory_set import draw, write
from acqd.lab.cell import MAINS, Cell, build_cell
from acqd.lab.instruments.data_recorder import Recorded, log_suffix
from acqd.lab.instruments.full_speed_plc import FullSpeedDaemon
from acqd.lab.instruments.mains import Mains
from acqd.lab.plant import Stretch
from acqd.lab.schedule import SessionPlan, plan_sessions
from acqd.lab.session import Session
from acqd.lab.settings import CampaignSettings
from acqd.motion.controller import Motion, Phase, Wait
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import read_log

_RATE = 1000.0
_OWN_DELAY_S = 0.0005  # of a plant whose supply lags by half a sample: the mean of two samples
_CHUNK = 10_000
_WINDOW_NS = 40_000_000


class Supply(NamedTuple):
    """What lies between the demand and the mains."""

    lag_s: float = 0.0
    """First order."""
    delay_s: float = 0.0
    """Pure."""


@dataclass(frozen=True)
class Played:
    """One session: its demand and its recordings."""

    start_s: float
    """Since the start of the campaign."""
    demand: Floats
    """[T] W at 1 kHz."""
    recordings: dict[str, tuple[float, float]]
    """Name -> start since the start of the session, and length, in s."""


@dataclass(frozen=True)
class Campaign:
    """All sessions of a campaign, and its logs on a true clock."""

    cell: Cell
    sessions: list[Played]
    logs: list[RobotLog]
    middles: Floats
    """[logs] s since the start of the campaign: true time at the middle of each recording."""


class _Unmetered(Session):
    """A session that keeps its demand instead of metering the mains power."""

    def _play(self, motion: Motion, recording: int, *, recorded: bool) -> Recorded:
        voltage = self._mains.voltage(self._ms, len(motion))
        trace = self._plant.run(motion, voltage, Stretch(self.elapsed_s, recording, recorded))
        self._powers.append(trace.power)
        self._ms += len(motion)
        return trace.recorded

    def demand(self) -> Floats:
        """[T] W at 1 kHz."""
        self.pause([Wait(2.0)], 0)
        self._daemon.close()
        return np.concatenate(self._powers)


def campaign(folder: Path, robot: str, seed: int, recordings: int) -> Campaign:
    """The campaign in `folder`, which is played if it does not exist; half of it is in limited space."""
    half = recordings // 2
    settings = CampaignSettings.model_validate(
        {
            "robot": robot, "seed": seed, "limited": half, "all_space": recordings - half, "session": 4,
            "clock": {"offset_s": 0.0, "drift_ppm": 0.0}, "recorder": {"missing": 0.02},
        }
    )  # fmt: skip
    cell = build_cell(settings)
    supply = cell.parameters.supply.model_copy(update={"lag_s": _OWN_DELAY_S})
    parameters = cell.parameters.model_copy(update={"supply": supply})
    # logs are written as CSV with times in microseconds: the study rounds them after it has changed their clock
    cell = replace(cell, parameters=parameters, robot=cell.robot.model_copy(update={"log": []}))
    folders = Folders(folder, folder / "truth")
    sessions = [_played(cell, plan, folders) for plan in plan_sessions(settings)]
    names = {name: k for k, session in enumerate(sessions) for name in session.recordings}
    logs = [read_log(folders.logs(cell.device) / (name + log_suffix(cell.robot)), cell.robot) for name in names]
    start_s = settings.start_utc_ns * 1e-9
    logs = [replace(log, time=log.time - start_s) for log in logs]
    starts = [(sessions[k].start_s, *sessions[k].recordings[name]) for name, k in names.items()]
    middles = np.array([start + begin + seconds / 2 for start, begin, seconds in starts])
    return Campaign(cell, sessions, logs, middles)


def _played(cell: Cell, plan: SessionPlan, folders: Folders) -> Played:
    path = folders.out / f"{plan.name}.npz"
    if not path.exists():
        _play(cell, plan, folders, path)
    with np.load(path) as arrays:
        spans = {str(name): (float(a), float(b)) for name, a, b in zip(*(arrays[k] for k in "nab"), strict=True)}
        return Played(plan.start_s, arrays["demand"].astype(np.float64), spans)


def _play(cell: Cell, plan: SessionPlan, folders: Folders, path: Path) -> None:
    settings = cell.settings
    assert isinstance(settings, CampaignSettings)
    folders.logs(cell.device).mkdir(parents=True, exist_ok=True)
    if not folders.trajectories.exists():
        drawn = draw(cell, limited=settings.limited, all_space=settings.all_space)
        write(drawn, cell, folders.trajectories)
    programs = Programs(cell, folders)
    start_ns = settings.start_utc_ns + round(plan.start_s * 1e9)
    session = _Unmetered(cell, plan.number, start_ns, programs.start(plan.recordings[0]), lambda _: None)
    for recording in plan.recordings:
        transfer = cell.planner.connect(session.controller.position, programs.start(recording))
        session.pause([Phase("transfer"), *transfer, Wait(settings.pause_s)], recording.number)
        log = folders.logs(cell.device) / (recording.name + log_suffix(cell.robot))
        session.record(programs.program(recording), recording.number, recording.name, log)
    done = session.truth.recordings
    demand = session.demand().astype(np.float32)
    partial = path.with_suffix(f".{os.getpid()}.npz")
    spans = {"n": [r.name for r in done], "a": [r.start_s for r in done], "b": [r.seconds for r in done]}
    np.savez_compressed(partial, allow_pickle=False, demand=demand, **{k: np.array(v) for k, v in spans.items()})
    partial.replace(path)


def metered(played: Campaign, supply: Supply, cache: Path) -> PowerStream:
    """The power rows of all sessions behind `supply`, in a stream whose time starts with the campaign."""
    path = cache / f"rows-{1000 * supply.lag_s:g}-{1000 * supply.delay_s:g}.npz"
    if not path.exists():
        parts = [np.concatenate(list(_rows(played.cell, k, s, supply))) for k, s in enumerate(played.sessions)]
        np.savez_compressed(path, allow_pickle=False, **{f"s{k}": part for k, part in enumerate(parts)})
    with np.load(path) as arrays:
        parts = [arrays[f"s{k}"] for k in range(len(played.sessions))]
    times = [
        round(s.start_s * 1e9) + _WINDOW_NS * np.arange(len(p)) for s, p in zip(played.sessions, parts, strict=True)
    ]
    P = np.concatenate(parts)
    return PowerStream(np.concatenate(times), P, np.full(len(P), 230.0), _WINDOW_NS, 0, "simulated", "study")


def _rows(cell: Cell, number: int, session: Played, supply: Supply) -> Iterator[Floats]:
    """[windows] W of one session, by the daemon's own metering."""
    power = behind(session.demand, supply)
    mains = Mains(cell.settings.mains, cell.random(MAINS, number))
    daemon = FullSpeedDaemon(mains.form, cell.settings.window_s, 0)
    for first in range(0, len(power), _CHUNK):
        for batch in daemon.feed(mains.waveform(power[first : first + _CHUNK])):
            yield np.asarray(batch.P[0], dtype=np.float64)
    daemon.close()


def behind(demand: Floats, supply: Supply) -> Floats:
    """[T] W drawn from the mains for `demand` [T] W at 1 kHz."""
    power = demand
    delay_s = supply.delay_s - (_OWN_DELAY_S if supply.delay_s else 0.0)
    if delay_s:
        t = np.arange(len(power)) / _RATE
        power = np.interp(t - delay_s, t, power)
    if supply.lag_s:
        c = 2 * (supply.lag_s - _OWN_DELAY_S) * _RATE
        b, a = np.array([1.0, 1.0]) / (1 + c), np.array([1.0, (1 - c) / (1 + c)])
        power, _ = lfilter(b, a, power, zi=power[:1] * (1 - b[0]))
    return np.asarray(power)
