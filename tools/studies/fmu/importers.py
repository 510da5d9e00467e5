"""Independent FMU importers: each steps an FMU through given inputs and returns the power after every step."""

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
    """Power [T] W for inputs [T, k] that are held from row to row."""
    import fmpy

    rows = [(row * STEP_S, *line) for row, line in enumerate(values)]
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in names)])
    result = fmpy.simulate_fmu(
        str(fmu), start_time=0.0, stop_time=len(values) * STEP_S, output_interval=STEP_S, step_size=STEP_S,
        input=_held(signals), output=["power"], validate=True,
    )  # fmt: skip
    return np.asarray(result["power"][1:])


def _held(signals: NDArray[Any]) -> NDArray[Any]:
    """Every value twice: fmpy interpolates linearly between rows, and so gets steps."""
    doubled = np.repeat(signals, 2)
    doubled["time"][1::2] += 0.9 * STEP_S
    return doubled


def with_ecospy(fmu: Path, names: list[str], values: Floats) -> Floats:
    """Power [T] W for inputs [T, k] that are held from row to row."""
    for library in (Path(sys.prefix) / "lib").glob("libtbb.so.12"):  # from the wheel of tbb
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    structure.add_model("one", str(fmu))
    power = []
    with EcosSimulation(structure=structure, step_size=STEP_S) as simulation:
        simulation.init()
        for line in values:
            for name, value in zip(names, line.tolist(), strict=True):
                simulation.set_real(f"one::{name}", value)
            simulation.step()
            power.append(simulation.get_real("one::power"))
        simulation.terminate()
    return np.array(power)


def with_libcosimpy(fmu: Path, names: list[str], values: Floats) -> Floats:
    """Power [T] W for inputs [T, k] that are held from row to row; FMI 2 only."""
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
    power = []
    for line in values:
        manipulator.slave_real_values(slave, references, line.tolist())
        execution.step()
        power.append(observer.last_real_values(slave, [len(names)])[0])
    return np.array(power)


IMPORTERS = {"fmpy": with_fmpy, "ecospy": with_ecospy, "libcosimpy": with_libcosimpy}


def run_importer(importer: str, fmu: Path, names: list[str], inputs: Path, out: Path) -> str:
    """Run an importer in a separate process, because it may crash. Returns an error message or ""."""
    done = subprocess.run(
        [
            sys.executable, "-m", "tools.studies.fmu.importers", importer, str(fmu), ",".join(names), str(inputs),
            str(out),
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        return lines[-1][:90]
    return ""


if __name__ == "__main__":
    _, importer, file, names, inputs, out = sys.argv
    np.save(out, IMPORTERS[importer](Path(file), names.split(","), np.load(inputs)))
