"""The same inputs through independent importers; each gives the power after every step."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STEP_S = 0.04


def with_fmpy(fmu: Path, names: list[str], values: Floats) -> Floats:
    """[T] W; inputs [T, k] hold from one row to the next."""
    import fmpy

    rows = [(row * STEP_S, *line) for row, line in enumerate(values)]
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in names)])
    result = fmpy.simulate_fmu(
        str(fmu), start_time=0.0, stop_time=len(values) * STEP_S, output_interval=STEP_S, step_size=STEP_S,
        input=_held(signals), output=["power"], validate=True,
    )  # fmt: skip
    return np.asarray(result["power"][1:])


def _held(signals: NDArray[Any]) -> NDArray[Any]:
    """fmpy draws lines between rows: every value twice, so that they become steps."""
    doubled = np.repeat(signals, 2)
    doubled["time"][1::2] += 0.9 * STEP_S
    return doubled


def with_ecospy(fmu: Path, names: list[str], values: Floats) -> Floats:
    """[T] W."""
    for library in (Path(sys.prefix) / "lib").glob("libtbb.so.12"):  # of the wheel tbb
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    structure.add_model("one", str(fmu))
    found = []
    with EcosSimulation(structure=structure, step_size=STEP_S) as simulation:
        simulation.init()
        for line in values:
            for name, value in zip(names, line.tolist(), strict=True):
                simulation.set_real(f"one::{name}", value)
            simulation.step()
            found.append(simulation.get_real("one::power"))
        simulation.terminate()
    return np.array(found)


def with_libcosimpy(fmu: Path, names: list[str], values: Floats) -> Floats:
    """[T] W; FMI 2 only."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(step_size=int(STEP_S * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmu), instance_name="one"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    references = list(range(len(names)))
    found = []
    for line in values:
        manipulator.slave_real_values(slave, references, line.tolist())
        execution.step()
        found.append(observer.last_real_values(slave, [len(names)])[0])
    return np.array(found)


IMPORTERS = {"fmpy": with_fmpy, "ecospy": with_ecospy, "libcosimpy": with_libcosimpy}


def apart(importer: str, fmu: Path, names: list[str], inputs: Path, out: Path) -> str:
    """In a process of its own: an importer that crashes says so. "" or the reason."""
    done = subprocess.run(
        [
            sys.executable, "-m", "tools.studies.fmu.importers", importer, str(fmu), ",".join(names), str(inputs),
            str(out),
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
        return lines[-1][:90]
    return ""


if __name__ == "__main__":
    _, chosen, file, listed, given, into = sys.argv
    np.save(into, IMPORTERS[chosen](Path(file), listed.split(","), np.load(given)))
