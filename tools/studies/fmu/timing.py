"""Time of a step of an FMU of FMI 2.0 in a host program in C: set inputs, doStep, get output."""

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


def compiled_host(folder: Path) -> Path:
    """Compile the host program into `folder`."""
    out = folder / "host"
    source = Path(__file__).parent / "host.c"
    subprocess.run(["cc", "-O2", "-Wall", "-Wextra", f"-I{_C}", str(source), "-o", str(out), "-ldl", "-lm"], check=True)
    return out


@dataclass(frozen=True, slots=True)
class StepTime:
    """Time of a step in microseconds."""

    median_us: float
    p99_us: float


@dataclass(frozen=True, slots=True)
class UnpackedFmu:
    """What the host program needs to know about an FMU."""

    library: Path
    token: str
    resources: str
    numbers: tuple[int, int, int, int]
    """Value reference of the first input, number of angles, number of other inputs, value reference of the power."""

    @classmethod
    def of(cls, fmu: Path, folder: Path) -> UnpackedFmu:
        """Unpack an FMU into `folder`."""
        import fmpy

        description = fmpy.read_model_description(str(fmu), validate=False)
        fmpy.extract(str(fmu), str(folder))
        reals = [v for v in description.modelVariables if v.type == "Real"]
        inputs = [v for v in reals if v.causality == "input"]
        angles = [v for v in inputs if v.name.startswith("q")]
        power = next(v for v in reals if v.causality == "output" and v.name.startswith("power"))
        numbers = (inputs[0].valueReference, len(angles), len(inputs) - len(angles), power.valueReference)
        library = folder / "binaries" / "linux64" / f"{description.coSimulation.modelIdentifier}.so"
        return cls(library, description.guid, (folder / "resources").resolve().as_uri(), numbers)


def step_time(host: Path, fmu: UnpackedFmu, steps: int, wrapper: tuple[str, ...] = ()) -> StepTime | str:
    """Time of `steps` steps, or an error message. `wrapper`: a command such as valgrind that runs the host."""
    command = [*wrapper, str(host), str(fmu.library), fmu.token, fmu.resources, *map(str, fmu.numbers)]
    done = subprocess.run([*command, str(steps)], capture_output=True, text=True, check=False, env=_with_python())
    times: dict[str, Any] = json.loads(done.stdout) if done.stdout.startswith("{") else {}
    if times and (not wrapper or not done.returncode):
        return StepTime(times["median_us"], times["p99_us"])
    return (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1][:80]


def _with_python() -> dict[str, str]:
    """Environment in which an FMU of pythonfmu finds this interpreter."""
    library = Path(sysconfig.get_config_var("LIBDIR") or "") / str(sysconfig.get_config_var("LDLIBRARY"))
    if library.suffix != ".so":
        return dict(os.environ)
    packages = sysconfig.get_path("purelib")
    return os.environ | {"LD_PRELOAD": str(library), "PYTHONHOME": sys.base_prefix, "PYTHONPATH": packages}
