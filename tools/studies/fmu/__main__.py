"""Independent tests of FMUs: importers, valgrind, step times in a C host, FMUs of the same network by other tools.

    python -m tools.studies.fmu BUNDLE... [--steps 20000] [--json FILE]

Needs acqd[fmu-check] and a C compiler; valgrind is used if it is installed. The other tools are onnx2fmu, which
downloads ONNX Runtime, and pythonfmu.
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
from tools.studies.fmu.importers import IMPORTERS, STEP_S, Floats, run_importer
from tools.studies.fmu.rivals import RIVALS, FoldedNetwork
from tools.studies.fmu.timing import VALGRIND, StepTime, UnpackedFmu, compiled_host, step_time
from tools.studies.fmu.trials import TRIALS, run_trials

VERSIONS: tuple[Version, ...] = ("2.0", "3.0")


def motion(model: Predictor, rows: int = 1500) -> Floats:
    """A minute of smooth motion [rows, inputs]. The brakes open after a second, the tool switches every 3 s."""
    random = np.random.default_rng(1)
    t = STEP_S * np.arange(rows)
    q = np.zeros((rows, model.axes))
    for _ in range(3):
        rate, phase = random.uniform(0.05, 0.4, model.axes), random.uniform(0, 6, model.axes)
        size = random.uniform(0.1, 0.5, model.axes)
        q += size * np.sin(2 * np.pi * rate * t[:, None] + phase)
    signals = {"brake": (t > 1.0) * 1.0, "tool": (t % 6 > 3) * 1.0, "Vrms": 230 + 2 * np.sin(t / 9)}
    return np.column_stack([q, *(signals[name] for name in model.signals)])


def expected(model: Predictor, inputs: Floats) -> Floats:
    """Power [T] W by the bundle in Python, with those effects that an FMU contains."""
    from acqd.fmu.variables import exported_terms

    if isinstance(model, Augmented):
        model = Augmented(model.base, model.carrier, exported_terms(model))
    return model.sequence(inputs[:, : model.axes], inputs[:, model.axes :])


def imported(fmu: Path, model: Predictor, folder: Path, rows: Floats) -> dict[str, float | str]:
    """Largest difference in W from the prediction in Python, or an error message, by importer."""
    np.save(folder / "inputs.npy", rows)
    reference = expected(model, rows)[: len(rows) - model.radius]
    names = [f"q{k + 1}" for k in range(model.axes)] + list(model.signals)
    results: dict[str, float | str] = {}
    for importer in (name for name in IMPORTERS if find_spec(name) is not None):
        out = folder / "power.npy"
        error = run_importer(importer, fmu, names, folder / "inputs.npy", out)
        results[importer] = error or float(np.abs(np.load(out)[model.radius :] - reference).max())
    return results


def check(bundle: Path, folder: Path, steps: int, progress: Any) -> dict[str, Any]:
    """All results for one bundle."""
    folder.mkdir()
    _, model = open_model(bundle)
    host = compiled_host(folder)
    results: dict[str, Any] = {"versions": {}, "others": {}}
    rows = motion(model)
    for version in VERSIONS:
        progress(f"{bundle.name}, FMI {version}")
        exported = export_fmu(bundle, folder / f"{version}.fmu", version, ["linux64"], lambda _: None)
        differences = imported(exported.path, model, folder, rows)
        results["versions"][version] = {"bytes": exported.bytes, "importers": differences}
    fmus = {"acqd": folder / "2.0.fmu"}
    if isinstance(model, NetworkPredictor):
        for name, build in RIVALS.items():
            if find_spec(name) is None:
                continue
            progress(f"{bundle.name} by {name}")
            try:
                fmus[name] = build(FoldedNetwork.of(model), folder / name)
            except RuntimeError as error:
                results["others"][name] = {"failed": str(error)}
    np.save(folder / "trial.npy", rows[:600])
    for name, fmu in fmus.items():
        progress(f"{bundle.name}: C host and trials with the FMU of {name}")
        unpacked = UnpackedFmu.of(fmu, folder / f"{name}.d")
        time = step_time(host, unpacked, steps)
        results["others"][name] = {
            "bytes": fmu.stat().st_size, "step": asdict(time) if isinstance(time, StepTime) else time,
            "trials": run_trials(fmu, folder / "trial.npy"),
        }  # fmt: skip
        if name == "acqd":
            checked = step_time(host, unpacked, 300, VALGRIND) if shutil.which("valgrind") else "not installed"
            results["valgrind"] = "clean" if isinstance(checked, StepTime) else checked
    return results


def show(console: Console, results: dict[str, Any]) -> None:
    """Print a table of importers and a table of other tools."""
    names = [name for name in IMPORTERS if find_spec(name) is not None]
    matrix = Table("bundle", "FMI", "kB", *names, "valgrind", title="importers: largest difference from the bundle [W]")
    title = "C host, FMI 2.0; trials: largest error [W]"
    others = Table("bundle", "FMU by", "kB", "us per step", "p99 [us]", *TRIALS, title=title)
    for bundle, result in results.items():
        for version, fmu in result["versions"].items():
            differences = [cell(fmu["importers"].get(name, "")) for name in names]
            matrix.add_row(bundle, version, f"{fmu['bytes'] / 1000:.0f}", *differences, result["valgrind"])
        for name, fmu in result["others"].items():
            if "failed" in fmu:
                others.add_row(bundle, name, "", fmu["failed"])
                continue
            step = fmu["step"]
            times = [f"{step['median_us']:.2f}", f"{step['p99_us']:.2f}"] if isinstance(step, dict) else [step, ""]
            others.add_row(bundle, name, f"{fmu['bytes'] / 1000:.0f}", *times, *map(cell, fmu["trials"].values()))
    console.print(matrix)
    console.print(others)


def cell(value: float | str) -> str:
    """A number, or an error message as it is."""
    return value if isinstance(value, str) else f"{value:.1e}" if value else "0"


def main() -> None:
    """Check all bundles and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundles", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--json", type=Path, help="file for the results as JSON")
    arguments = parser.parse_args()
    console = Console(stderr=True)
    with tempfile.TemporaryDirectory() as scratch, console.status("") as status:
        results = {
            bundle.name: check(bundle, Path(scratch) / str(k), arguments.steps, status.update)
            for k, bundle in enumerate(arguments.bundles)
        }
    show(Console(width=150), results)
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    for_people(main)
