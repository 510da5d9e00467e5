"""FMUs judged by others: importers, valgrind, step times from a C host; the same network by onnx2fmu and pythonfmu.

    python -m tools.studies.fmu BUNDLE... [--steps 20000] [--json FILE]

Needs acqd[fmu-check]; valgrind and a C compiler are used where they are there. onnx2fmu downloads ONNX Runtime.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from acqd.cli.main import for_people
from acqd.fmu.description import Version
from acqd.fmu.package import export_fmu
from acqd.models.augmented import Augmented
from acqd.models.bundle.restore import open_model
from acqd.models.networks.predictor import NetworkPredictor
from acqd.models.predictor import Predictor
from tools.studies.fmu.importers import IMPORTERS, STEP_S, Floats, apart
from tools.studies.fmu.rivals import RIVALS, Plain
from tools.studies.fmu.timing import VALGRIND, Stage, Timed, compiled, timed
from tools.studies.fmu.trials import TRIALS, judged

VERSIONS: tuple[Version, ...] = ("2.0", "3.0")


def motion(model: Predictor, rows: int = 1500) -> Floats:
    """[rows, inputs] a minute of smooth motion; brakes open after a second, the tool switches now and then."""
    random = np.random.default_rng(1)
    t = STEP_S * np.arange(rows)
    q = np.zeros((rows, model.axes))
    for _ in range(3):
        rate, phase = random.uniform(0.05, 0.4, model.axes), random.uniform(0, 6, model.axes)
        size = random.uniform(0.1, 0.5, model.axes)
        q += size * np.sin(2 * np.pi * rate * t[:, None] + phase)
    signals = {"brake": (t > 1.0) * 1.0, "tool": (t % 6 > 3) * 1.0, "Vrms": 230 + 2 * np.sin(t / 9)}
    return np.column_stack([q, *(signals[name] for name in model.signals)])


def wanted(model: Predictor, inputs: Floats) -> Floats:
    """The bundle's own prediction, of what an FMU holds."""
    from acqd.fmu.variables import exported_terms

    if isinstance(model, Augmented):
        model = Augmented(model.base, model.carrier, exported_terms(model))
    return model.sequence(inputs[:, : model.axes], inputs[:, model.axes :])


def imported(fmu: Path, model: Predictor, folder: Path, rows: Floats) -> dict[str, float | str]:
    """W apart from the bundle's own prediction by importer, or why it cannot."""
    np.save(folder / "inputs.npy", rows)
    right = wanted(model, rows)[: len(rows) - model.radius]
    names = [f"q{k + 1}" for k in range(model.axes)] + list(model.signals)
    found: dict[str, float | str] = {}
    for importer in (name for name in IMPORTERS if find_spec(name) is not None):
        out = folder / "power.npy"
        reason = apart(importer, fmu, names, folder / "inputs.npy", out)
        found[importer] = reason or float(np.abs(np.load(out)[model.radius :] - right).max())
    return found


def check(bundle: Path, folder: Path, steps: int, say: Any) -> dict[str, Any]:
    """Everything about one bundle."""
    folder.mkdir()
    _, model = open_model(bundle)
    master = compiled(folder)
    found: dict[str, Any] = {"versions": {}, "others": {}}
    rows = motion(model)
    for version in VERSIONS:
        say(f"{bundle.name}, FMI {version}")
        made = export_fmu(bundle, folder / f"{version}.fmu", version, ["linux64"], lambda _: None)
        found["versions"][version] = {"bytes": made.bytes, "importers": imported(made.path, model, folder, rows)}
    fmus = {"acqd": folder / "2.0.fmu"}
    if isinstance(model, NetworkPredictor):
        for name, build in RIVALS.items():
            if find_spec(name) is None:
                continue
            say(f"{bundle.name} by {name}")
            try:
                fmus[name] = build(Plain.of(model), folder / name)
            except RuntimeError as error:
                found["others"][name] = {"failed": str(error)}
    np.save(folder / "trial.npy", rows[:600])
    for name, fmu in fmus.items():
        say(f"{bundle.name}: a C host and trials on the FMU of {name}")
        stage = Stage.of(fmu, folder / f"{name}.d")
        cost = timed(master, stage, steps)
        found["others"][name] = {
            "bytes": fmu.stat().st_size, "step": asdict(cost) if isinstance(cost, Timed) else cost,
            "trials": judged(fmu, folder / "trial.npy"),
        }  # fmt: skip
        if name == "acqd":
            clean = timed(master, stage, 300, VALGRIND) if shutil.which("valgrind") else "not installed"
            found["valgrind"] = "clean" if isinstance(clean, Timed) else clean
    return found


def show(console: Console, found: dict[str, Any]) -> None:
    """Two tables."""
    names = [name for name in IMPORTERS if find_spec(name) is not None]
    matrix = Table("bundle", "FMI", "kB", *names, "valgrind", title="importers: W apart from the bundle, at most")
    others = Table("bundle", "FMU of", "kB", "us a step", "p99", *TRIALS, title="C host, FMI 2.0; trials: W off")
    for bundle, one in found.items():
        for version, about in one["versions"].items():
            told = [cell(about["importers"].get(name, "")) for name in names]
            matrix.add_row(bundle, version, f"{about['bytes'] / 1000:.0f}", *told, one["valgrind"])
        for name, about in one["others"].items():
            if "failed" in about:
                others.add_row(bundle, name, "", about["failed"])
                continue
            step = about["step"]
            cost = [f"{step['median_us']:.2f}", f"{step['p99_us']:.2f}"] if isinstance(step, dict) else [step, ""]
            others.add_row(bundle, name, f"{about['bytes'] / 1000:.0f}", *cost, *map(cell, about["trials"].values()))
    console.print(matrix)
    console.print(others)


def cell(value: float | str) -> str:
    """A number or a reason."""
    return value if isinstance(value, str) else f"{value:.1e}" if value else "0"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundles", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--json", type=Path, help="also write the figures there")
    arguments = parser.parse_args()
    console = Console(stderr=True)
    with tempfile.TemporaryDirectory() as scratch, console.status("") as status:
        found = {
            bundle.name: check(bundle, Path(scratch) / str(k), arguments.steps, status.update)
            for k, bundle in enumerate(arguments.bundles)
        }
    show(Console(width=150), found)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    for_people(main)
