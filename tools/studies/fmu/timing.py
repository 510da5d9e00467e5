"""What a step costs, from a master in C: set inputs, doStep, get; FMI 2.0."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_C = Path(__file__).parents[3] / "acqd" / "fmu" / "c"
VALGRIND = (
    "valgrind", "-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite,indirect,possible",
)  # fmt: skip


def compiled(folder: Path) -> Path:
    """The master."""
    out = folder / "host"
    source = Path(__file__).parent / "host.c"
    subprocess.run(["cc", "-O2", "-Wall", "-Wextra", f"-I{_C}", str(source), "-o", str(out), "-ldl", "-lm"], check=True)
    return out


@dataclass(frozen=True, slots=True)
class Timed:
    """Microseconds of a step."""

    median_us: float
    p99_us: float


@dataclass(frozen=True, slots=True)
class Stage:
    """An FMU unpacked for the master."""

    library: Path
    token: str
    resources: str
    numbers: tuple[int, int, int, int]
    """First input, inputs that are angles, other inputs, the output."""

    @classmethod
    def of(cls, fmu: Path, folder: Path) -> Stage:
        """Unpack."""
        import fmpy

        about = fmpy.read_model_description(str(fmu), validate=False)
        fmpy.extract(str(fmu), str(folder))
        reals = [v for v in about.modelVariables if v.type == "Real"]
        inputs = [v for v in reals if v.causality == "input"]
        angles = [v for v in inputs if v.name.startswith("q")]
        power = next(v for v in reals if v.causality == "output" and v.name.startswith("power"))
        numbers = (inputs[0].valueReference, len(angles), len(inputs) - len(angles), power.valueReference)
        library = folder / "binaries" / "linux64" / f"{about.coSimulation.modelIdentifier}.so"
        return cls(library, about.guid, (folder / "resources").resolve().as_uri(), numbers)


def timed(master: Path, stage: Stage, steps: int, before: tuple[str, ...] = ()) -> Timed | str:
    """Of that many steps; what went wrong otherwise."""
    command = [*before, str(master), str(stage.library), stage.token, stage.resources, *map(str, stage.numbers)]
    done = subprocess.run([*command, str(steps)], capture_output=True, text=True, check=False, env=_with_python())
    found: dict[str, Any] = json.loads(done.stdout) if done.stdout.startswith("{") else {}
    if found and (not before or not done.returncode):
        return Timed(found["median_us"], found["p99_us"])
    return (done.stderr.strip().splitlines() or [f"ended with {done.returncode}"])[-1][:80]


def _with_python() -> dict[str, str]:
    """An FMU that is Python finds the interpreter that runs this."""
    library = Path(sysconfig.get_config_var("LIBDIR") or "") / str(sysconfig.get_config_var("LDLIBRARY"))
    if library.suffix != ".so":
        return dict(os.environ)
    packages = sysconfig.get_path("purelib")
    return os.environ | {"LD_PRELOAD": str(library), "PYTHONHOME": sys.base_prefix, "PYTHONPATH": packages}
