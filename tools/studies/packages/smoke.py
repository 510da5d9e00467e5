"""The uses of acqd, one per function, as somebody has them who has installed the wheel with one extra and no more.

Runs in a separate environment, outside the source tree: python smoke.py USE. All data are simulated.
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np

ROBOT = "ur10e"
STEP_S = 0.04


def command(*arguments: object) -> str:
    """The command's output."""
    call = [sys.executable, "-m", "acqd", *map(str, arguments)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"acqd {arguments[0]}: exit {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout


def daemon() -> str:
    """Replay of a recording, the daemon for two seconds, and the sink's database."""
    t = np.arange(40_000) / 20_000
    u, i = 325.3 * np.sin(100 * np.pi * t), 4.0 * np.sin(100 * np.pi * t - 0.4)
    lines = [f"{a:.6f},{b:.4f},{c:.5f}" for a, b, c in zip(t, u, i, strict=True)]
    Path("w.csv").write_text("\n".join(["time,U1,I1", *lines, ""]))
    command("replay", "w.csv", "--out", "rows.jsonl")
    rows = [json.loads(line) for line in Path("rows.jsonl").read_text().splitlines()]
    assert len(rows) == 50 and abs(rows[-1]["P"] - 0.5 * 325.3 * 4.0 * np.cos(0.4)) < 0.5, rows[-1]
    from acqd.compiling import PREBUILT
    from acqd.metering.kernel.compiled import library

    compiled = "C of the wheel" if Path(library(2)._name).parent == PREBUILT else "C of the cache"
    assert which("cc") is None and which("git") is None
    done = command("run", "--duration", "3", "--json")
    assert done.strip(), "the daemon prints nothing"
    return f"{len(rows)} rows, metered with {compiled}; the daemon ran for 3 s"


def dataset(name: str, payload_kg: float, seed: int) -> None:
    """A dataset of logs and power of a virtual arm, in the folder `name`."""
    import acqd as api

    robot, random = api.Robot(ROBOT), np.random.default_rng(seed)
    logs, power = Path(f"{name}-logs"), []
    logs.mkdir()
    for number in range(9):
        t = np.arange(900) * STEP_S
        rate, phase = random.uniform(0.04, 0.2, (2, 3, robot.axes))
        q = sum(0.4 * np.sin(2 * np.pi * r * t[:, None] + 30 * p) for r, p in zip(rate, phase, strict=True))
        qd = np.gradient(q, STEP_S, axis=0)
        tau = robot.torque(q, qd, np.gradient(qd, STEP_S, axis=0))
        lifted = payload_kg * 9.81 * 0.7 * np.cos(q[:, 1])
        tau[:, 1] += lifted
        motor = tau + 5 * np.tanh(qd / 0.02) + 6 * qd
        P = 120 + 1.05 * (motor * qd).sum(axis=1) + 0.002 * (motor**2).sum(axis=1) + random.normal(0, 0.5, len(t))
        t += 1.7e9 + seed * 10_000 + number * 100
        head = ",".join(["time", *(f"q{k + 1}" for k in range(robot.axes))])
        rows = [f"{s:.3f}," + ",".join(f"{angle:.6f}" for angle in angles) for s, angles in zip(t, q, strict=True)]
        (logs / f"r_{seed}_{number:02d}.csv").write_text("\n".join([head, *rows, ""]))
        power += [f"{s - STEP_S / 2:.3f},{watts:.4f}" for s, watts in zip(t, P, strict=True)]  # stamps of their begin
    Path(f"{name}.csv").write_text("\n".join(["time,P", *power, ""]))
    command("dataset", "build", "--power", f"{name}.csv", "--logs", logs, "--robot", ROBOT, "--lag", 0, "--out", name)


def loop() -> str:
    """A grey box from a dataset, the closing loop on another one with a payload, and the check of the robot."""
    import acqd as api

    unwanted = [name for name in ("pinocchio", "pyarrow") if find_spec(name)]
    assert not unwanted, unwanted
    command("robot", "check", ROBOT, "--out", "robot.html")

    dataset("before", 0.0, 1)
    dataset("now", 3.0, 2)
    model = api.train("before", out="model")
    result = api.close_loop("now", model, "loop")
    assert (Path("loop") / "report.html").exists() and result.verdict == "effects_found", result.verdict
    return f"verdict {result.verdict}: {', '.join(effect['id'] for effect in result.effects)}"


def sidecar() -> str:
    """The command, and what it imports."""
    command("sidecar", "--help")
    import acqd.dataset.regressors
    import acqd.sidecar.service
    import acqd.sidecar.worker  # noqa: F401

    unwanted = [name for name in ("pinocchio", "pyarrow", "torch", "matplotlib", "jinja2") if find_spec(name)]
    assert not unwanted, unwanted
    return "imports without Pinocchio, pyarrow, torch and matplotlib"


def fmu() -> str:
    """The command: a bundle comes from elsewhere."""
    command("export-fmu", "--help")
    import acqd.fmu.package  # noqa: F401

    return "imports"


if __name__ == "__main__":
    print({"daemon": daemon, "loop": loop, "sidecar": sidecar, "fmu": fmu}[sys.argv[1]]())
