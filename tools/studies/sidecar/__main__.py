"""The sidecar under load, with a real broker: killed while logs arrive, timed on logs of 400 s, asked row by row.

    python -m tools.studies.sidecar OUT --campaign CAMPAIGN --model BUNDLE [--kills 100] [--json FILE]

CAMPAIGN is a folder of `acqd lab campaign` (simulated data), BUNDLE a model of its robot. Prints what is asked of the
sidecar: every log processed exactly once, seconds from a whole file to the published prediction, the live round trip.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion
from rich.console import Console
from rich.progress import track
from rich.table import Table

from acqd.cli.main import for_people
from acqd.errors import OperationError, UserError
from acqd.models.bundle.restore import open_model
from acqd.models.networks.predictor import NetworkPredictor, example_inputs
from acqd.robot.description import load_description
from acqd.robot.log import read_log
from acqd.storage.database import open_database
from acqd.storage.writer import Received, Writer
from acqd.telemetry import topics
from tools.common.servers import mosquitto
from tools.studies.measured_robots.__main__ import acqd

_DEVICE = "cell-01"
_LONG_S = 400.0


@dataclass(slots=True)
class Ear:
    """Everything that is published below a topic, with the time of arrival."""

    port: int
    topic: str
    heard: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    client: paho.Client = field(default_factory=lambda: paho.Client(CallbackAPIVersion.VERSION2))

    def __enter__(self) -> Ear:
        self.client.on_connect = lambda c, *_: c.subscribe(self.topic, qos=1)
        self.client.on_message = lambda _c, _d, m: self.heard.append((time.monotonic(), orjson.loads(m.payload)))
        self.client.connect("127.0.0.1", self.port)
        self.client.loop_start()
        return self

    def __exit__(self, *_: object) -> None:
        self.client.loop_stop()

    def wait(self, count: int, seconds: float) -> None:
        """Raises OperationError when so many do not come."""
        end = time.monotonic() + seconds
        while len(self.heard) < count:
            if time.monotonic() > end:
                raise OperationError(f"{self.topic}: {len(self.heard)} of {count} messages within {seconds:.0f} s")
            time.sleep(0.01)


@dataclass(frozen=True, slots=True)
class Cell:
    """Where the sidecar works."""

    logs: Path
    database: Path
    model: Path
    port: int

    def command(self, *more: str) -> list[str]:
        return [
            sys.executable, "-m", "acqd", "sidecar", str(self.logs), "--model", str(self.model), "--database",
            str(self.database), "--port", str(self.port), "--device", _DEVICE, *more,
        ]  # fmt: skip

    @contextmanager
    def running(self, *more: str) -> Iterator[subprocess.Popen[bytes]]:
        process = subprocess.Popen(self.command(*more), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            yield process
        finally:
            process.terminate()
            process.wait()


def feed(sources: list[Path], logs: Path, stop: threading.Event, chance: random.Random, pace_s: float) -> None:
    """As a robot and its file server do: some at once, some in pieces, some under another name first."""
    for source in sources:
        if stop.wait(chance.uniform(0, 2 * pace_s)):
            break
        way, target, whole = chance.randrange(3), logs / source.name, source.read_bytes()
        if way == 0:
            target.write_bytes(whole)
        elif way == 1:
            cut = chance.randrange(len(whole))
            target.write_bytes(whole[:cut])
            time.sleep(0.2)
            with target.open("ab") as file:
                file.write(whole[cut:])
        else:
            part = target.with_suffix(".part")
            part.write_bytes(whole)
            part.rename(target)


def killed(cell: Cell, sources: list[Path], kills: int, seed: int) -> dict[str, Any]:
    """kill -9 again and again while logs arrive; then what the database and the broker hold."""
    chance, stop = random.Random(seed), threading.Event()
    pace_s = 3.0 * kills / len(sources)
    with Ear(cell.port, f"acqd/{_DEVICE}/prediction") as ear:
        feeder = threading.Thread(target=feed, args=(sources, cell.logs, stop, random.Random(seed + 1), pace_s))
        feeder.start()
        for _ in track(range(kills), "killing", console=Console(stderr=True)):
            process = subprocess.Popen(cell.command(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(chance.uniform(1.0, 5.0))
            process.send_signal(signal.SIGKILL)
            process.wait()
        feeder.join()
        last = subprocess.run(cell.command("--until-idle"), capture_output=True, text=True, check=False)
        if last.returncode:
            raise OperationError(f"the last start failed: {last.stderr}")
        told = [message["sha256"] for _, message in ear.heard]
    with open_database(str(cell.database), create=False).connect() as connection:
        logs = connection.exec_driver_sql("SELECT sha256, name, status, message FROM prediction_log").all()
        query = "SELECT sha256, count(*) FROM prediction GROUP BY sha256"
        counts: dict[str, int] = {row[0]: row[1] for row in connection.exec_driver_sql(query)}
    wrong = [name for sha256, name, status, text in logs if not _whole(status, text, counts.get(sha256, 0))]
    return {
        "logs": len(sources), "kills": kills, "processed": len({name for _, name, _, _ in logs}),
        "once": len(logs) == len(sources), "refused": sum(status == "refused" for _, _, status, _ in logs),
        "rows_wrong": len(wrong), "published": len(set(told)), "published_again": len(told) - len(set(told)),
    }  # fmt: skip


def _whole(status: str, text: Any, rows: int) -> bool:
    message = text if isinstance(text, dict) else json.loads(text)
    return rows == (message["rows"] if status == "ok" else 0)


def long_log(campaign: Path, out: Path) -> tuple[Path, Path]:
    """A log of 400 s and a database with its power."""
    out.mkdir(parents=True, exist_ok=True)
    lines = [path.read_text().splitlines() for path in sorted((campaign / "trajectories").glob("all_*.csv"))[:8]]
    trajectory, run = out / "long.csv", out / "run"
    trajectory.write_text("\n".join([lines[0][0], *(line for each in lines for line in each[1:]), ""]))
    settings = out / "lab.toml"
    settings.write_text(
        'scene = "free"\n'
    )  # one trajectory's end and the next one's begin may lie on two sides of a wall
    acqd("lab", "execute", str(trajectory), "--out", str(run), "--settings", str(settings))
    rows = [Received(topics.power(_DEVICE, "L1"), line) for line in (run / "rows.jsonl").read_bytes().splitlines()]
    database = out / "power.sqlite"
    Writer(open_database(str(database))).write(rows)
    return run / "long.log", database


def timed(cell: Cell, log: Path, count: int) -> dict[str, Any]:
    """Seconds from a whole file to its prediction on the broker, and memory."""
    lines = log.read_text().splitlines()
    seconds = []
    with Ear(cell.port, f"acqd/{_DEVICE}/prediction") as ear, cell.running() as process:
        for number in range(count + 1):
            part = cell.logs / f"long_{number}.part"
            part.write_text("\n".join([*lines[: len(lines) - number], ""]))
            begun = time.monotonic()
            part.rename(part.with_suffix(".log"))
            ear.wait(number + 1, 60.0)
            seconds.append(ear.heard[-1][0] - begun)
            if ear.heard[-1][1]["status"] != "ok":
                raise OperationError(f"refused: {ear.heard[-1][1]['reason']}")
        status = Path(f"/proc/{process.pid}/status").read_text()
        inner = [message["seconds"] for _, message in ear.heard]
    memory = {line.split(":")[0]: int(line.split()[1]) / 1000 for line in status.splitlines() if line.startswith("Vm")}
    rows = ear.heard[-1][1]["rows"]
    return {
        "logs": count, "log_s": rows * 0.04, "seconds_median": float(np.median(seconds[1:])),
        "seconds_max": max(seconds[1:]), "seconds_first": seconds[0], "work_median": float(np.median(inner[1:])),
        "rss_MB": memory["VmRSS"], "rss_peak_MB": memory["VmHWM"],
    }  # fmt: skip


def live(cell: Cell, log: Path, rows: int) -> dict[str, Any]:
    """Round trip of a row: joints published, prediction heard."""
    bundle, model = open_model(cell.model)
    motion = read_log(log, load_description(bundle.metadata["description"])).q[:rows]
    sent: dict[float, float] = {}
    with Ear(cell.port, f"acqd/{_DEVICE}/prediction/live") as ear, cell.running("--live"):
        sender = paho.Client(CallbackAPIVersion.VERSION2)
        sender.connect("127.0.0.1", cell.port)
        sender.loop_start()
        time.sleep(6.0)  # it starts
        begin, first = time.monotonic(), 1_700_000_000.0
        for number, q in enumerate(motion):
            stamp = round(first + 0.04 * number, 3)
            time.sleep(max(0.0, begin + 0.04 * number - time.monotonic()))
            sent[stamp] = time.monotonic()
            row = {"time": stamp, "q": q.tolist(), "brake": 1, "tool": 0}
            sender.publish(f"acqd/{_DEVICE}/joints", orjson.dumps(row))
        time.sleep(1.0)
        sender.loop_stop()
    late = model.radius * model.step_s
    trips = [1000 * (at - sent[round(m["time"] + late, 3)]) for at, m in ear.heard]
    steps = [m["step_ms"] for _, m in ear.heard]
    return {
        "rows": len(motion), "answered": len(trips), "round_trip_ms": _spread(trips), "step_ms": _spread(steps),
    }  # fmt: skip


def runtime(model_path: Path, log: Path) -> dict[str, Any]:
    """What torch would save and cost: the network of the bundle over a whole log."""
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
        found = {"numpy_s": _seconds(lambda: model.sequence(q)), "torch_s": _seconds(lambda: network(inputs))}
    asked = "import resource, torch; print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000)"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    installed = sum(f.stat().st_size for f in Path(torch.__file__).parent.rglob("*") if f.is_file())
    return found | {"torch_import_MB": float(done.stdout), "torch_installed_MB": installed / 1e6}


def _seconds(work: Callable[[], object]) -> float:
    took = []
    for _ in range(5):
        begun = time.perf_counter()
        work()
        took.append(time.perf_counter() - begun)
    return float(np.median(took))


def _spread(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "p99": float(np.percentile(values, 99)), "max": max(values)}


def main() -> None:
    """All of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--campaign", type=Path, required=True)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--logs", type=int, default=200, help="that arrive meanwhile")
    parser.add_argument("--live-rows", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    if given.out.exists():
        raise UserError(f"{given.out} exists; name another folder")
    (given.out / "logs").mkdir(parents=True)
    (given.out / "long" / "logs").mkdir(parents=True)
    found: dict[str, Any] = {}
    with mosquitto() as port:
        log, database = long_log(given.campaign, given.out / "long")
        cell = Cell(given.out / "long" / "logs", database, given.model, port)
        found["log of 400 s"] = timed(cell, log, 10)
        found["runtime"] = runtime(given.model, log)
        found["live"] = live(cell, log, given.live_rows)
        shutil.copy(given.campaign / "power.sqlite", given.out / "power.sqlite")
        sources = sorted((given.campaign / "logs").rglob("*.log"))[: given.logs]
        cell = Cell(given.out / "logs", given.out / "power.sqlite", given.model, port)
        found["killed"] = killed(cell, sources, given.kills, given.seed)
    table = Table("trial", "what", "measured")
    for trial, figures in found.items():
        for name, value in figures.items():
            table.add_row(trial, name, json.dumps(value) if isinstance(value, dict) else f"{value}")
    Console(width=120).print(table)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    for_people(main)
