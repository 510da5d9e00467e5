"""From campaigns to models: time shifts, training speed, errors on held-out recordings, inference speed."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Iterator
from datetime import datetime
from functools import partial
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
from tools.common.commands import acqd_json

_HARD = """[recorder]
missing = 0.05
[clock]
offset_s = {offset}
drift_ppm = {drift}
"""
_STEPS, _BATCH = 1250, 11


def _lag_errors(campaign: Path, dataset: Path) -> Floats:
    """|estimated - true lag| of every recording [ms]; infinite where a recording is missing in the dataset."""
    truth = json.loads((campaign.with_name(campaign.name + ".truth") / "truth.json").read_text())
    settings = truth["settings"]
    start = datetime.fromisoformat(settings["start"].replace("Z", "+00:00")).timestamp()
    recordings = json.loads((dataset / "manifest.json").read_text())["recordings"]
    estimated = {entry["name"]: entry["lag_s"] for entry in recordings}
    errors = []
    for session in truth["sessions"]:
        with np.load(campaign.with_name(campaign.name + ".truth") / f"{session['session']}.npz") as arrays:
            session_start = float(arrays["start_utc_ns"]) * 1e-9 - start
        for recording in session["recordings"]:
            middle = session_start + recording["start_s"] + recording["seconds"] / 2
            true = settings["clock"]["offset_s"] + settings["clock"]["drift_ppm"] * 1e-6 * middle
            errors.append(estimated.get(recording["name"], np.inf) - true)
    return np.asarray(1000 * np.abs(np.array(errors)))


def time_shifts() -> Iterator[Figure]:
    """Clock offset 30 s, drift 50 ppm, 5 % of the log rows missing; with and without torque sensors, four robots."""
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
                acqd_json(
                    "lab", "campaign", "--out", campaign, "--robot", robot, *size, "--settings", folder / "lab.toml"
                )
            inputs = ("--power", campaign / "power.sqlite", "--logs", campaign / "logs", "--robot", robot)
            acqd_json("dataset", "build", *inputs, "--torque", torque, "--out", out)
            error = float(np.percentile(_lag_errors(campaign, out), 95))
            label = "torque sensors" if torque == "measured" else "inverse dynamics"
            yield Figure(section, f"{robot}, {label}", error, "ms", f"<= {target}")


def training_step() -> Iterator[Figure]:
    """One gradient of a batch of 11 sequences of 1250 steps: the fused C code and torch.nn.LSTM, one thread each."""
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
        times = _interleaved(
            partial(torch_engine.gradient, parameters, slow), partial(fused.gradient, parameters, fast)
        )
        error = float(np.abs(gradient - reference).max() / np.abs(reference).max())
        yield Figure(section, f"{name}: torch / {fused.name}", times[0] / times[1], "", ">= 4")
        yield Figure(section, f"{name}: {fused.name}", 1000 * times[1], "ms")
        yield Figure(section, f"{name}: gradient minus autograd's, share of the largest", error, "", "<= 1e-5")


def _interleaved(first: Callable[[], object], second: Callable[[], object], rounds: int = 15) -> tuple[float, float]:
    """Median durations [s] of two calls, made in turn: the machine's noise affects both alike."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        for work, durations in zip((first, second), times, strict=True):
            begun = time.perf_counter()
            work()
            durations.append(time.perf_counter() - begun)
    return float(np.median(times[0])), float(np.median(times[1]))


def thesis_campaign() -> Iterator[Figure]:
    """Merge 4.9 h, train 21x1dim by the thesis' protocol and the grey box, compare on the same held-out recordings."""
    section = "thesis campaign (simulated)"
    with tempfile.TemporaryDirectory(prefix="acqd-bench-") as name:
        campaign, ds = Path(name) / "c", Path(name) / "ds"
        acqd_json("lab", "campaign", "--out", campaign, "--seed", 78)
        begun = time.perf_counter()
        report = acqd_json(
            "dataset", "build", "--power", campaign / "power.sqlite", "--logs", campaign / "logs", "--out", ds
        )
        yield Figure(section, f"merging {report['seconds'] / 3600:.1f} h", time.perf_counter() - begun, "s", "<= 60")
        yield Figure(section, "time shift, 95 %", float(np.percentile(_lag_errors(campaign, ds), 95)), "ms", "<= 5")
        for network in ("21x1dim", "grey-box"):
            begun = time.perf_counter()
            acqd_json("train", ds, "--network", network)
            yield Figure(section, f"training {network}", time.perf_counter() - begun, "s")
        compared = acqd_json("compare", ds)
        models = {model["name"]: model["test"]["everything"] for model in compared["models"] + compared["baselines"]}
        yield Figure(section, "21x1dim: MAE", models["21x1dim"]["mae"], "W", "<= 4.15")
        yield Figure(section, "grey box: MAE", models["grey-box"]["mae"], "W", "<= 2.0")
        yield Figure(section, "grey box: RMSE", models["grey-box"]["rmse"], "W", "<= 3.0")
        yield Figure(
            section, "grey box: energy of a recording, 95 %", 100 * models["grey-box"]["energy_p95"], "%", "<= 1"
        )
        for baseline in ("linear physics", "constant"):
            yield Figure(section, f"{baseline}: MAE", models[baseline]["mae"], "W")
        yield Figure(section, "noise floor: MAE", compared["noise_floor_W"], "W")
        yield from _inference(Path(name) / "ds.models")


def _inference(models: Path) -> Iterator[Figure]:
    section = "inference compared with 21x1dim, plain numpy"
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
