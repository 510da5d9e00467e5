"""Models in use: the cost of an FMU's step compared with other exporters, and the speed of the sidecar."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from tools.bench.report import Figure
from tools.common.commands import acqd
from tools.common.servers import mosquitto
from tools.studies.fmu.__main__ import check
from tools.studies.sidecar.__main__ import Cell, live, long_log, timed

_OTHERS = ("onnx2fmu", "pythonfmu")


def fmu_and_sidecar() -> Iterator[Figure]:
    """A small simulated campaign and a 21x1dim of a few epochs: its errors do not matter here."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign, dataset, bundle = folder / "campaign", folder / "ds", folder / "21x1dim"
        acqd("lab", "campaign", "--out", str(campaign), "--limited", "8", "--all", "8", "--seed", "9")
        source = ("--power", f"{campaign}/power.sqlite", "--logs", f"{campaign}/logs")
        acqd("dataset", "build", *source, "--robot", "iiwa7_r800", "--out", str(dataset))
        acqd("train", str(dataset), "--network", "21x1dim", "--epochs", "4", "--out", str(bundle))
        yield from _fmu(bundle, folder / "fmu")
        yield from _sidecar(campaign, bundle, folder / "long")


def _fmu(bundle: Path, folder: Path) -> Iterator[Figure]:
    exporters = check(bundle, folder, 20_000, lambda _: None)["others"]
    step = exporters["acqd"]["step"]["median_us"]
    yield Figure("work", "FMU step of 21x1dim from a C host", step, "us", "<= 1")
    yield Figure("work", "FMU file", exporters["acqd"]["bytes"] / 1000, "kB", "<= 200")
    for name in _OTHERS:
        other = exporters.get(name, {}).get("step")
        if isinstance(other, dict):  # acqd[fmu-check] is installed
            yield Figure("work", f"FMU step compared with {name}", other["median_us"] / step, "times faster", ">= 10")


def _sidecar(campaign: Path, bundle: Path, folder: Path) -> Iterator[Figure]:
    log, database = long_log(campaign, folder)
    (folder / "logs").mkdir()
    with mosquitto() as port:
        cell = Cell(folder / "logs", database, bundle, port)
        whole = timed(cell, log, 5)
        rows = live(cell, log, 750)
    yield Figure("work", "400 s log closed -> published, median", whole["seconds_median"], "s", "<= 2")
    yield Figure("work", "sidecar's memory (RSS)", whole["rss_MB"], "MB")
    yield Figure("work", "live row -> prediction, through the broker, p99", rows["round_trip_ms"]["p99"], "ms", "<= 5")
