"""The memory that a long log takes."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from acqd.models import features
from acqd.storage.database import open_database
from tests.builders import AXES, STEP, grey
from tests.commands import ACQD
from tests.sidecar.cell import BEGIN, CLOCK, power_of, store_power
from tests.sidecar.runs import sidecar

SECONDS, HZ, OTHER_COLUMNS = 7200, 125, 27
MOST_MB = 400
MEASURED = [
    sys.executable,
    "-c",
    "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True);"
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)",
]
"""Runs a command and prints its peak [kB]: a child of this large process would begin with this process's peak."""


def write_long_log(path, url):
    """350 MB as a controller writes them that records 41 columns, and the power of that time."""
    chance, rows = np.random.default_rng(1), int(SECONDS / STEP)
    wander = gaussian_filter1d(chance.normal(0, 1, (rows, AXES)), 20, axis=0)
    wander *= 0.5 / wander.std()
    ease = np.clip(np.minimum(np.arange(rows) - 50, rows - 50 - np.arange(rows)) / 60, 0, 1)[:, None]
    q = wander[50] + ease**3 * (10 - 15 * ease + 6 * ease**2) * (wander - wander[50])
    P = power_of(np.concatenate([np.repeat(q[:1], 100, axis=0), q, np.repeat(q[-1:], 100, axis=0)]), 3)
    for first in range(0, len(P), 20_000):
        store_power(url, P[first : first + 20_000], BEGIN + (first - 100) * STEP, first)
    tau = grey().motor_torque(*features.motion(q, STEP))[0]
    motion = CubicSpline(np.arange(rows) * STEP, np.column_stack([q, tau]))
    names = [f"{quantity}{k + 1}" for quantity in ("q", "tau") for k in range(AXES)]
    with path.open("w") as file:
        file.write(",".join(["time", *names, "brake", *(f"x{k}" for k in range(OTHER_COLUMNS))]) + "\n")
        for begin in np.arange(0, SECONDS - STEP, 160.0):
            t = np.arange(begin, min(begin + 160.0, SECONDS - STEP), 1 / HZ)
            other = chance.normal(0, 1, (len(t), OTHER_COLUMNS))
            columns = [BEGIN + CLOCK + t, motion(t), np.ones(len(t)), other]
            shapes = ["%.4f", *["%.6f"] * 2 * AXES, "%d", *["%.6f"] * OTHER_COLUMNS]
            np.savetxt(file, np.column_stack(columns), fmt=shapes, delimiter=",")


@pytest.mark.minutes
def test_a_log_of_two_hours_takes_at_most_400_mb(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    open_database(url)
    write_long_log(logs / "long.csv", url)
    assert (logs / "long.csv").stat().st_size > 340e6
    command = [*ACQD, *sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json")]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    out = subprocess.run([*MEASURED, *command], stdout=subprocess.PIPE, env=environment, check=True).stdout
    message, *_, peak_kb = map(json.loads, out.splitlines())
    assert message["status"] == "ok" and message["lag_s"] == pytest.approx(CLOCK, abs=0.01)
    assert message["covered"] > 0.99 and message["rmse_W"] < 2
    assert peak_kb / 1024 < MOST_MB
