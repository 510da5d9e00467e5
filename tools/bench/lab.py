"""The virtual laboratory: the whole thesis campaign, and its motions checked by MuJoCo."""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Iterator

import numpy as np

from acqd.lab.campaign.trajectory_set import draw
from acqd.lab.cell import MOTION, build_cell
from acqd.lab.settings import LabSettings
from acqd.motion.controller import RATE, Controller
from tools.bench.report import Figure
from tools.common import mujoco_oracle
from tools.common.commands import acqd_json

_SECTION = "virtual laboratory (simulated)"


def campaign() -> Iterator[Figure]:
    """202 + 135 recordings: waveforms at 20 kHz, metered by the daemon's tasks, rows in SQLite."""
    with tempfile.TemporaryDirectory(prefix="acqd-bench-") as folder:
        begun = time.perf_counter()
        report = acqd_json("lab", "campaign", "--out", f"{folder}/c")
        minutes = (time.perf_counter() - begun) / 60
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    yield Figure(_SECTION, "thesis campaign, wall time", minutes, "min", "<= 15")
    yield Figure(_SECTION, "streamed waveform", report["sample_pairs"] / 1e6, "M sample pairs")
    yield Figure(_SECTION, "largest process", memory, "MB", "<= 2000")
    yield Figure(_SECTION, "recorded", report["recorded_s"] / 3600, "h")
    yield Figure(_SECTION, "standby", report["standby_W"], "W")
    for space, figures in report["spaces"].items():
        yield Figure(_SECTION, f"{space} space: mean", figures["mean_W"], "W")
        yield Figure(_SECTION, f"{space} space: p99", figures["p99_W"], "W")
        yield Figure(_SECTION, f"{space} space: max", figures["max_W"], "W")
    steady = report["steady_error"]
    yield Figure(_SECTION, "metered against true P, steady, RMS per window", 100 * steady["window_rms"], "%", "<= 0.1")
    yield Figure(_SECTION, "metered against true P, steady, worst window", 100 * steady["window_worst"], "%", "<= 0.1")
    yield Figure(_SECTION, "metered against true P, steady, worst second", 100 * steady["second_worst"], "%", "<= 0.1")
    yield Figure(_SECTION, "energy unaccounted for, worst session", report["energy_unaccounted"], "", "<= 1e-6")


def motions() -> Iterator[Figure]:
    """Every source trajectory executed once: limits at every row, collisions every 0.5 deg by MuJoCo."""
    cell = build_cell(LabSettings())
    drawn = draw(cell, limited=46, all_space=30)
    clearance, speed, acceleration, inside = np.inf, 0.0, 0.0, True
    for number, trajectory in enumerate([*drawn.limited, *drawn.all_space]):
        program = cell.planner.program(trajectory, cell.random(MOTION, number, 1))
        motion = Controller(cell.robot, trajectory.waypoints[0]).run(program)
        travelled = np.cumsum(np.abs(motion.qd).max(axis=1)) / RATE
        fine = motion.q[np.diff(travelled // np.radians(0.5), prepend=-1) > 0]
        clearance = min(clearance, mujoco_oracle.clearance(cell.robot, cell.scene, fine))
        speed = max(speed, float((np.abs(motion.qd) / cell.robot.speed).max()))
        acceleration = max(acceleration, float((np.abs(motion.qdd) / cell.robot.acceleration).max()))
        inside &= bool((motion.q >= cell.robot.lower - 1e-9).all() and (motion.q <= cell.robot.upper + 1e-9).all())
    yield Figure(_SECTION, "76 motions: smallest clearance by MuJoCo, every 0.5 deg", 1000 * clearance, "mm", ">= 0")
    yield Figure(_SECTION, "76 motions: largest share of an axis' speed", speed, "", "<= 1")
    yield Figure(_SECTION, "76 motions: largest share of an axis' acceleration", acceleration, "", "<= 1")
    yield Figure(_SECTION, "76 motions: all positions within the axis limits", float(inside), "", ">= 1")
    tally = drawn.limited_tally
    yield Figure(_SECTION, "points drawn again as unreachable", float(tally.unreachable), f"of {tally.points}")
