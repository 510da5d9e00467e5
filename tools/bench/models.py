"""Time shifts of datasets; training speed, errors on held-out recordings and inference time of models."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.models.bundle.restore import open_model
from acqd.models.networks.architecture import ARCHITECTURES, architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.flat_parameters import initial
from acqd.models.networks.fused.engine import FusedEngine
from acqd.models.networks.torch_engine import TorchEngine
from acqd.models.predictor import Stream
from tools.bench.report import Figure

_HARD = """[recorder]
missing = 0.05
[clock]
offset_s = {offset}
drift_ppm = {drift}
"""
_STEPS, _BATCH = 1250, 11


def _acqd(*arguments: object) -> Any:
    command = [sys.executable, "-P", "-m", "acqd", *map(str, arguments), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def _lag_errors(campaign: Path, dataset: Path) -> Floats:
    """|estimated - true time shift| of every recording, ms."""
    truth = json.loads((campaign.with_name(campaign.name + ".truth") / "truth.json").read_text())
    settings = truth["settings"]
    start = datetime.fromisoformat(settings["start"].replace("Z", "+00:00")).timestamp()
    lags = {
        entry["name"]: entry["lag_s"] for entry in json.loads((dataset / "manifest.json").read_text())["recordings"]
    }
    errors = []
    for session in truth["sessions"]:
        with np.load(campaign.with_name(campaign.name + ".truth") / f"{session['session']}.npz") as arrays:
            session_start = float(arrays["start_utc_ns"]) * 1e-9 - start
        for recording in session["recordings"]:
            middle = session_start + recording["start_s"] + recording["seconds"] / 2
            true = settings["clock"]["offset_s"] + settings["clock"]["drift_ppm"] * 1e-6 * middle
            errors.append(lags.get(recording["name"], np.inf) - true)
    return np.asarray(1000 * np.abs(np.array(errors)))


def time_shifts() -> Iterator[Figure]:
    """Clocks apart by 30 s and 50 ppm, 5 % of the log rows missing; four robots, with and without torque sensors."""
    section = "time shift, 95 % of recordings (simulated)"
    cases = [("iiwa7_r800", "measured", 30.0, 50.0, 5), ("iiwa7_r800", "model", 30.0, 50.0, 10)]
    cases += [(robot, "model", -30.0, -50.0, 10) for robot in ("ur3e", "ur10e", "kinova_gen3")]
    with tempfile.TemporaryDirectory(prefix="acqd-bench-") as name:
        folder = Path(name)
        for robot, torque, offset, drift, target in cases:
            campaign, out = folder / robot, folder / f"{robot}-{torque}"
            (folder / "lab.toml").write_text(_HARD.format(offset=offset, drift=drift))
            if not campaign.exists():
                size = ("--limited", 12, "--all", 12, "--session", 8, "--seed", 5)
                _acqd("lab", "campaign", "--out", campaign, "--robot", robot, *size, "--settings", folder / "lab.toml")
            inputs = ("--power", campaign / "power.sqlite", "--logs", campaign / "logs", "--robot", robot)
            _acqd("dataset", "build", *inputs, "--torque", torque, "--out", out)
            error = float(np.percentile(_lag_errors(campaign, out), 95))
            label = "torque sensors" if torque == "measured" else "inverse dynamics"
            yield Figure(section, f"{robot}, {label}", error, "ms", f"<= {target}")


def training_step() -> Iterator[Figure]:
    """Gradient of a batch of 11 sequences of 1250 steps: the fused engine against torch.nn.LSTM on one thread."""
    section = "training, one optimiser step"
    random = np.random.default_rng(0)
    for name in ARCHITECTURES:
        chosen = architecture(name)
        parameters = initial(chosen, 7, 1)
        margin = 2 * chosen.radius if chosen.kernels else 0
        width = 7 if chosen.kernels else chosen.width(7)
        inputs = random.standard_normal((_BATCH, _STEPS + margin, width)).astype(np.float32)
        batch = Batch(inputs, random.standard_normal((_BATCH, _STEPS)).astype(np.float32))
        torch_engine, fused = TorchEngine(chosen, 7), FusedEngine(chosen, 7)
        slow, fast = torch_engine.prepare(batch), fused.prepare(batch)
        reference, gradient = torch_engine.gradient(parameters, slow)[1], fused.gradient(parameters, fast)[1]
        times = _interleaved(lambda: torch_engine.gradient(parameters, slow), lambda: fused.gradient(parameters, fast))  # noqa: B023
        error = float(np.abs(gradient - reference).max() / np.abs(reference).max())
        yield Figure(section, f"{name}: torch / {fused.name}", times[0] / times[1], "", ">= 4")
        yield Figure(section, f"{name}: {fused.name}", 1000 * times[1], "ms")
        yield Figure(section, f"{name}: largest error of the gradient against autograd, relative", error, "", "<= 1e-5")


def _interleaved(one: Callable[[], object], other: Callable[[], object], rounds: int = 15) -> tuple[float, float]:
    """Median run times in s. The two alternate, so that the load of the machine affects both equally."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        for work, seconds in zip((one, other), times, strict=True):
            started = time.perf_counter()
            work()
            seconds.append(time.perf_counter() - started)
    return float(np.median(times[0])), float(np.median(times[1]))


def thesis_campaign() -> Iterator[Figure]:
    """A dataset of 4.9 h, then 21x1dim by the thesis' protocol and the grey box on the same held-out recordings."""
    section = "thesis campaign (simulated)"
    with tempfile.TemporaryDirectory(prefix="acqd-bench-") as name:
        campaign, ds = Path(name) / "c", Path(name) / "ds"
        _acqd("lab", "campaign", "--out", campaign, "--seed", 78)
        started = time.perf_counter()
        report = _acqd(
            "dataset", "build", "--power", campaign / "power.sqlite", "--logs", campaign / "logs", "--out", ds
        )
        yield Figure(section, f"merging {report['seconds'] / 3600:.1f} h", time.perf_counter() - started, "s", "<= 60")
        yield Figure(section, "time shift, 95 %", float(np.percentile(_lag_errors(campaign, ds), 95)), "ms", "<= 5")
        for network in ("21x1dim", "grey-box"):
            started = time.perf_counter()
            _acqd("train", ds, "--network", network)
            yield Figure(section, f"training {network}", time.perf_counter() - started, "s")
        comparison = _acqd("compare", ds)
        entries = comparison["models"] + comparison["baselines"]
        models = {entry["name"]: entry["test"]["everything"] for entry in entries}
        yield Figure(section, "21x1dim: MAE", models["21x1dim"]["mae"], "W", "<= 4.15")
        yield Figure(section, "grey box: MAE", models["grey-box"]["mae"], "W", "<= 2.0")
        yield Figure(section, "grey box: RMSE", models["grey-box"]["rmse"], "W", "<= 3.0")
        yield Figure(
            section, "grey box: energy of a recording, 95 %", 100 * models["grey-box"]["energy_p95"], "%", "<= 1"
        )
        for baseline in ("linear physics", "constant"):
            yield Figure(section, f"{baseline}: MAE", models[baseline]["mae"], "W")
        yield Figure(section, "noise floor: MAE", comparison["noise_floor_W"], "W")
        yield from _inference(Path(name) / "ds.models")


def _inference(models: Path) -> Iterator[Figure]:
    section = "inference relative to 21x1dim, plain numpy"
    _, network = open_model(models / "21x1dim-everything-s1")
    _, grey = open_model(models / "grey-box-everything-s1")
    q = np.cumsum(np.random.default_rng(1).normal(0, 0.01, (2000, 7)), axis=0)
    whole = _interleaved(lambda: network.sequence(q), lambda: grey.sequence(q), 9)
    yield Figure(section, "grey box / 21x1dim, whole recordings", whole[1] / whole[0], "", "<= 1")

    def stepwise(model: Any) -> None:
        stream = Stream(model)
        for row in q[:300]:
            stream.step(row)

    steps = _interleaved(lambda: stepwise(network), lambda: stepwise(grey), 7)
    yield Figure(section, "grey box / 21x1dim, row by row", steps[1] / steps[0], "", "<= 1")
    yield Figure(section, "grey box, one row", 1e6 * steps[1] / 300, "us")
