"""FMUs judged by others: importers, valgrind, step times from a C host, beside pythonfmu where it is installed.

    python -m tools.fmu_check BUNDLE... [--steps 20000]

Needs fmpy; ecospy (with tbb), libcosimpy and valgrind are used where they are there.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from acqd.fmu.description import IDENTIFIER, Version
from acqd.fmu.package import Exported, export_fmu
from acqd.models.augmented import Augmented
from acqd.models.predictor import Predictor
from acqd.models.restore import open_model
from tools.fmu.importers import IMPORTERS, STEP_S, Floats, apart

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


def host(folder: Path) -> Path:
    """The C master."""
    sources = Path(__file__).parent / "fmu" / "host.c"
    include = Path(__file__).parents[1] / "acqd" / "fmu" / "c"
    out = folder / "host"
    subprocess.run(
        ["cc", "-O2", "-Wall", "-Wextra", f"-I{include}", str(sources), "-o", str(out), "-ldl", "-lm"], check=True
    )
    return out


def timed(master: Path, made: Exported, model: Predictor, folder: Path, steps: int, before: list[str]) -> Any:
    """What the C host prints, or what went wrong."""
    import fmpy

    unpacked = folder / f"{made.path.stem}.d"
    if not unpacked.exists():
        fmpy.extract(str(made.path), str(unpacked))
    token = fmpy.read_model_description(str(made.path)).guid
    library = unpacked / "binaries" / "linux64" / f"{IDENTIFIER}.so"
    power = model.axes + len(model.signals)
    numbers = [str(each) for each in (model.axes, len(model.signals), power, steps)]
    done = subprocess.run(
        [*before, str(master), str(library), token, "", *numbers], capture_output=True, text=True, check=False
    )
    return json.loads(done.stdout) if not done.returncode else (done.stderr.strip().splitlines() or ["failed"])[-1]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bundles", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=20_000)
    arguments = parser.parse_args()
    console = Console(width=150)
    importers = [name for name in IMPORTERS if find_spec(name) is not None]
    matrix = Table("bundle", "FMI", "kB", *(f"{name}: max |dP| W" for name in importers), title="importers")
    times = Table(
        "bundle", "median us", "p99 us", "valgrind", title="a step (set inputs, doStep, get) from a C host, FMI 2.0"
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        master = host(folder)
        for bundle in arguments.bundles:
            _, model = open_model(bundle)
            inputs = motion(model)
            np.save(folder / "inputs.npy", inputs)
            right = wanted(model, inputs)[: len(inputs) - model.radius]
            names = [f"q{k + 1}" for k in range(model.axes)] + list(model.signals)
            for version in VERSIONS:
                made = export_fmu(bundle, folder / f"{bundle.name}-{version}.fmu", version, ["linux64"], lambda _: None)
                cells = []
                for importer in importers:
                    out = folder / "power.npy"
                    reason = apart(importer, made.path, names, folder / "inputs.npy", out)
                    off = np.inf if reason else float(np.abs(np.load(out)[model.radius :] - right).max())
                    cells.append(reason or f"{off:.1e}")
                matrix.add_row(bundle.name, version, f"{made.bytes / 1000:.0f}", *cells)
                if version == "2.0":
                    found = timed(master, made, model, folder, arguments.steps, [])
                    clean = "not installed"
                    if shutil.which("valgrind"):
                        checked = [
                            "valgrind",
                            "-q",
                            "--error-exitcode=9",
                            "--leak-check=full",
                            "--errors-for-leak-kinds=definite,indirect,possible",
                        ]
                        result = timed(master, made, model, folder, 300, checked)
                        clean = "clean" if isinstance(result, dict) else str(result)
                    told = found if isinstance(found, dict) else {"median_us": np.nan, "p99_us": np.nan}
                    times.add_row(bundle.name, f"{told['median_us']:.2f}", f"{told['p99_us']:.2f}", clean)
    console.print(matrix)
    console.print(times)


if __name__ == "__main__":
    main()
