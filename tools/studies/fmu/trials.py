"""Trials of an FMU with rows of 40 ms: what the FMI standard allows a master to do, with the result that must follow.

    python -m tools.studies.fmu.trials FMU INPUTS.npy TRIAL      -> {"off": largest error in W, or an error message}

Every trial is compared with the same FMU in the simplest use: set the inputs, make a step of 40 ms, read the output.
"""

from __future__ import annotations

import contextlib
import json
import logging
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STEP_S = 0.04
_HELD = 10  # rows in 0.4 s


@dataclass(slots=True)
class Unit:
    """One instance of an FMU."""

    slave: Any
    inputs: list[int]
    power: int
    time: float = 0.0

    def set(self, row: Floats) -> None:
        """Set the inputs [k]."""
        self.slave.setReal(self.inputs, row.tolist())

    def step(self, seconds: float) -> float:
        """Make a step and return the power in W."""
        self.slave.doStep(currentCommunicationPoint=self.time, communicationStepSize=seconds)
        self.time += seconds
        return float(self.slave.getReal([self.power])[0])

    def start(self) -> None:
        """Initialise at time 0."""
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.time = 0.0

    def simplest(self, rows: Floats) -> Floats:
        """Power [T] W of inputs [T, k], one step of 40 ms per row."""
        power = []
        for row in rows:
            self.set(row)
            power.append(self.step(STEP_S))
        return np.array(power)


@dataclass(slots=True)
class Unpacked:
    """An unpacked FMU."""

    folder: str
    described: Any
    inputs: list[int]
    power: int

    @contextmanager
    def unit(self) -> Iterator[Unit]:
        """An initialised instance, freed at the end."""
        from fmpy.fmi2 import FMU2Slave

        slave = FMU2Slave(
            guid=self.described.guid, unzipDirectory=self.folder,
            modelIdentifier=self.described.coSimulation.modelIdentifier, instanceName="one",
        )  # fmt: skip
        slave.instantiate()
        unit = Unit(slave, self.inputs, self.power)
        unit.start()
        yield unit
        with contextlib.suppress(Exception):
            slave.terminate()
        slave.freeInstance()


def blocks(rows: Floats) -> Floats:
    """Inputs [T, k] that change every 0.4 s only."""
    return np.repeat(rows[::_HELD], _HELD, axis=0)[: len(rows)]


def held(fmu: Unpacked, rows: Floats) -> Floats:
    """Error when inputs are set only when they change."""
    with fmu.unit() as one, fmu.unit() as other:
        expected, power = one.simplest(blocks(rows)), []
        for k, row in enumerate(rows):
            if k % _HELD == 0:
                other.set(row)
            power.append(other.step(STEP_S))
    return np.array(power) - expected


def fine(fmu: Unpacked, rows: Floats) -> Floats:
    """Error with a communication step of 10 ms."""
    with fmu.unit() as one, fmu.unit() as other:
        expected, power = one.simplest(rows), []
        for row in rows:
            other.set(row)
            power.append([other.step(STEP_S / 4) for _ in range(4)][-1])
    return np.array(power) - expected


def coarse(fmu: Unpacked, rows: Floats) -> Floats:
    """Error with a communication step of 0.4 s."""
    with fmu.unit() as one, fmu.unit() as other:
        expected, power = one.simplest(blocks(rows))[_HELD - 1 :: _HELD], []
        for row in rows[::_HELD]:
            other.set(row)
            power.append(other.step(_HELD * STEP_S))
    return np.array(power) - expected


def reset(fmu: Unpacked, rows: Floats) -> Floats:
    """Error of a second run after fmi2Reset."""
    with fmu.unit() as one:
        expected = one.simplest(rows)
        one.slave.reset()
        one.start()
        return one.simplest(rows) - expected


def moved(fmu: Unpacked, rows: Floats) -> Floats:
    """Error when the second half runs in another instance, from the serialised state."""
    half = len(rows) // 2
    with fmu.unit() as one, fmu.unit() as other:
        expected = one.simplest(rows)[half:]
        one.slave.reset()
        one.start()
        one.simplest(rows[:half])
        state = one.slave.getFMUstate()
        serialised = one.slave.serializeFMUstate(state)
        other.slave.setFMUstate(other.slave.deSerializeFMUstate(serialised))
        other.time = half * STEP_S
        return other.simplest(rows[half:]) - expected


TRIALS: dict[str, Callable[[Unpacked, Floats], Floats]] = {
    "held inputs": held, "10 ms": fine, "0.4 s": coarse, "reset": reset, "state moved": moved,
}  # fmt: skip


def unpack(fmu: Path, folder: str) -> Unpacked:
    """Unpack an FMU into `folder`."""
    import fmpy

    described = fmpy.read_model_description(str(fmu), validate=False)
    fmpy.extract(str(fmu), folder)
    reals = [v for v in described.modelVariables if v.type == "Real"]
    inputs = [v.valueReference for v in reals if v.causality == "input"]
    power = next(v.valueReference for v in reals if v.causality == "output" and v.name.startswith("power"))
    return Unpacked(folder, described, inputs, power)


def run_trials(fmu: Path, inputs: Path) -> dict[str, float | str]:
    """Largest error in W or an error message of each trial. Each runs in a separate process, because it may crash."""
    return {name: _run_trial(fmu, inputs, name) for name in TRIALS}


def _run_trial(fmu: Path, inputs: Path, name: str) -> float | str:
    command = [sys.executable, "-m", "tools.studies.fmu.trials", str(fmu), str(inputs), name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        if line.startswith("{"):
            return json.loads(line)["off"]  # type: ignore[no-any-return]
    return f"crash ({done.returncode})"


def main() -> None:
    """Run one trial and print its result as JSON."""
    fmu, inputs, name = sys.argv[1:]
    logging.disable()
    result: float | str
    with tempfile.TemporaryDirectory() as folder:
        try:
            result = float(np.abs(TRIALS[name](unpack(Path(fmu), folder), np.load(inputs))).max())
        except Exception as error:  # an FMU of another tool may raise anything
            result = f"{type(error).__name__}: {error}".split("\n")[0][:60]
        print(json.dumps({"off": result}), flush=True)


if __name__ == "__main__":
    main()
