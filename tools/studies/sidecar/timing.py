"""How long the sidecar takes: for a log of 400 s, for a live row, and for the network in numpy and torch."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.errors import OperationError
from acqd.models.bundle.restore import open_model
from acqd.models.networks.predictor import NetworkPredictor, example_inputs
from acqd.robot.description import load_description
from acqd.robot.log_reader import read_log
from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.writer import Writer
from acqd.telemetry import topics
from tools.studies.measured_robots.__main__ import acqd
from tools.studies.sidecar.cell import DEVICE, Cell, Listener

_PERIOD_S = 0.04


def long_log(campaign: Path, out: Path) -> tuple[Path, Path]:
    """A log of 400 s and a database with its power."""
    out.mkdir(parents=True, exist_ok=True)
    lines = [path.read_text().splitlines() for path in sorted((campaign / "trajectories").glob("all_*.csv"))[:8]]
    trajectory, run = out / "long.csv", out / "run"
    trajectory.write_text("\n".join([lines[0][0], *(line for part in lines for line in part[1:]), ""]))
    settings = out / "lab.toml"
    settings.write_text('scene = "free"\n')  # between two trajectories a wall would be in the way
    acqd("lab", "execute", str(trajectory), "--out", str(run), "--settings", str(settings))
    rows = [Received(topics.power(DEVICE, "L1"), line) for line in (run / "rows.jsonl").read_bytes().splitlines()]
    database = out / "power.sqlite"
    Writer(open_database(str(database))).write(rows)
    return run / "long.log", database


def timed(cell: Cell, log: Path, count: int) -> dict[str, Any]:
    """Seconds from a whole file to its prediction on the broker, and memory."""
    lines = log.read_text().splitlines()
    seconds = []
    with Listener(cell.port, f"acqd/{DEVICE}/prediction") as listener, cell.running() as process:
        for number in range(count + 1):
            part = cell.logs / f"long_{number}.part"
            part.write_text("\n".join([*lines[: len(lines) - number], ""]))
            started = time.monotonic()
            part.rename(part.with_suffix(".log"))
            listener.wait(number + 1, 60.0)
            arrived, message = listener.messages[-1]
            seconds.append(arrived - started)
            if message["status"] != "ok":
                raise OperationError(f"refused: {message['reason']}")
        status = Path(f"/proc/{process.pid}/status").read_text()
    work = [message["seconds"] for _, message in listener.messages]
    memory = {line.split(":")[0]: int(line.split()[1]) / 1000 for line in status.splitlines() if line.startswith("Vm")}
    return {
        "logs": count, "log_s": listener.messages[-1][1]["rows"] * _PERIOD_S,
        "seconds_median": float(np.median(seconds[1:])), "seconds_max": max(seconds[1:]),
        "seconds_first": seconds[0], "work_median": float(np.median(work[1:])),
        "rss_MB": memory["VmRSS"], "rss_peak_MB": memory["VmHWM"],
    }  # fmt: skip


def live(cell: Cell, log: Path, rows: int) -> dict[str, Any]:
    """Round trip of a row, from published joint angles to the received prediction."""
    bundle, model = open_model(cell.model)
    motion = read_log(log, load_description(bundle.metadata["description"])).q[:rows]
    sent: dict[float, float] = {}
    with Listener(cell.port, f"acqd/{DEVICE}/prediction/live") as listener, cell.running("--live"):
        sender = paho.Client(CallbackAPIVersion.VERSION2)
        sender.connect("127.0.0.1", cell.port)
        sender.loop_start()
        time.sleep(6.0)  # the sidecar starts
        start, first = time.monotonic(), 1_700_000_000.0
        for number, q in enumerate(motion):
            stamp = round(first + _PERIOD_S * number, 3)
            time.sleep(max(0.0, start + _PERIOD_S * number - time.monotonic()))
            sent[stamp] = time.monotonic()
            row = {"time": stamp, "q": q.tolist(), "brake": 1, "tool": 0}
            sender.publish(f"acqd/{DEVICE}/joints", orjson.dumps(row))
        time.sleep(1.0)
        sender.loop_stop()
    late_s = model.radius * model.step_s
    trips = [1000 * (arrived - sent[round(m["time"] + late_s, 3)]) for arrived, m in listener.messages]
    steps = [m["step_ms"] for _, m in listener.messages]
    return {
        "rows": len(motion), "answered": len(trips), "round_trip_ms": _spread(trips), "step_ms": _spread(steps),
    }  # fmt: skip


def runtime(model_path: Path, log: Path) -> dict[str, Any]:
    """Seconds and megabytes of the bundle's network over a whole log, with numpy and with torch."""
    bundle, model = open_model(model_path)
    if not isinstance(model, NetworkPredictor) or find_spec("torch") is None:
        return {}
    import torch

    from acqd.models.networks.torch_engine import Network

    q = read_log(log, load_description(bundle.metadata["description"])).q
    torch.set_num_threads(1)
    network = Network(model.architecture, model.axes)
    inputs = torch.from_numpy(example_inputs(model.architecture, model.normal, q, model.step_s)[None])
    with torch.no_grad():
        seconds = {"numpy_s": _seconds(lambda: model.sequence(q)), "torch_s": _seconds(lambda: network(inputs))}
    script = "import resource, torch; print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000)"
    memory = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    installed = sum(f.stat().st_size for f in Path(torch.__file__).parent.rglob("*") if f.is_file())
    return seconds | {"torch_import_MB": float(memory.stdout), "torch_installed_MB": installed / 1e6}


def _seconds(work: Callable[[], object]) -> float:
    """Median of five runs."""
    seconds = []
    for _ in range(5):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return float(np.median(seconds))


def _spread(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "p99": float(np.percentile(values, 99)), "max": max(values)}
