"""What a master may do with an FMU of 40 ms rows, and what must then come out: the same trials for anybody's FMU.

    python -m tools.studies.fmu.trials FMU INPUTS.npy TRIAL      -> {"off": W at most, or why it cannot be done}

Every trial is compared with the same FMU driven plainly: inputs set, a step of 40 ms, the output read.
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
    """One instance."""

    slave: Any
    inputs: list[int]
    power: int
    time: float = 0.0

    def set(self, row: Floats) -> None:
        self.slave.setReal(self.inputs, row.tolist())

    def step(self, seconds: float) -> float:
        self.slave.doStep(currentCommunicationPoint=self.time, communicationStepSize=seconds)
        self.time += seconds
        return float(self.slave.getReal([self.power])[0])

    def begin(self) -> None:
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.time = 0.0

    def plain(self, rows: Floats) -> Floats:
        found = []
        for row in rows:
            self.set(row)
            found.append(self.step(STEP_S))
        return np.array(found)


@dataclass(slots=True)
class Bench:
    """An unpacked FMU."""

    folder: str
    described: Any
    inputs: list[int]
    power: int

    @contextmanager
    def unit(self) -> Iterator[Unit]:
        from fmpy.fmi2 import FMU2Slave

        slave = FMU2Slave(
            guid=self.described.guid, unzipDirectory=self.folder,
            modelIdentifier=self.described.coSimulation.modelIdentifier, instanceName="one",
        )  # fmt: skip
        slave.instantiate()
        unit = Unit(slave, self.inputs, self.power)
        unit.begin()
        yield unit
        with contextlib.suppress(Exception):
            slave.terminate()
        slave.freeInstance()


def blocks(rows: Floats) -> Floats:
    """Inputs that change every 0.4 s only."""
    return np.repeat(rows[::_HELD], _HELD, axis=0)[: len(rows)]


def held(bench: Bench, rows: Floats) -> Floats:
    """Inputs are set when they change, not in every step."""
    with bench.unit() as one, bench.unit() as other:
        wanted, found = one.plain(blocks(rows)), []
        for k, row in enumerate(rows):
            if k % _HELD == 0:
                other.set(row)
            found.append(other.step(STEP_S))
    return np.array(found) - wanted


def fine(bench: Bench, rows: Floats) -> Floats:
    """A master of 10 ms."""
    with bench.unit() as one, bench.unit() as other:
        wanted, found = one.plain(rows), []
        for row in rows:
            other.set(row)
            found.append([other.step(STEP_S / 4) for _ in range(4)][-1])
    return np.array(found) - wanted


def coarse(bench: Bench, rows: Floats) -> Floats:
    """A master of 0.4 s."""
    with bench.unit() as one, bench.unit() as other:
        wanted, found = one.plain(blocks(rows))[_HELD - 1 :: _HELD], []
        for row in rows[::_HELD]:
            other.set(row)
            found.append(other.step(_HELD * STEP_S))
    return np.array(found) - wanted


def reset(bench: Bench, rows: Floats) -> Floats:
    """Everything again after fmi2Reset."""
    with bench.unit() as one:
        wanted = one.plain(rows)
        one.slave.reset()
        one.begin()
        return one.plain(rows) - wanted


def moved(bench: Bench, rows: Floats) -> Floats:
    """Half of it, then the serialised state goes on in another instance."""
    half = len(rows) // 2
    with bench.unit() as one, bench.unit() as other:
        wanted = one.plain(rows)[half:]
        one.slave.reset()
        one.begin()
        one.plain(rows[:half])
        state = one.slave.getFMUstate()
        kept = one.slave.serializeFMUstate(state)
        other.slave.setFMUstate(other.slave.deSerializeFMUstate(kept))
        other.time = half * STEP_S
        return other.plain(rows[half:]) - wanted


TRIALS: dict[str, Callable[[Bench, Floats], Floats]] = {
    "held inputs": held, "10 ms": fine, "0.4 s": coarse, "reset": reset, "state moved": moved,
}  # fmt: skip


def bench_of(fmu: Path, folder: str) -> Bench:
    """Unpack it."""
    import fmpy

    described = fmpy.read_model_description(str(fmu), validate=False)
    fmpy.extract(str(fmu), folder)
    reals = [v for v in described.modelVariables if v.type == "Real"]
    inputs = [v.valueReference for v in reals if v.causality == "input"]
    power = next(v.valueReference for v in reals if v.causality == "output" and v.name.startswith("power"))
    return Bench(folder, described, inputs, power)


def judged(fmu: Path, inputs: Path) -> dict[str, float | str]:
    """Each trial in a process of its own: its largest deviation, or what became of it."""
    return {name: _apart(fmu, inputs, name) for name in TRIALS}


def _apart(fmu: Path, inputs: Path, name: str) -> float | str:
    command = [sys.executable, "-m", "tools.studies.fmu.trials", str(fmu), str(inputs), name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        if line.startswith("{"):
            return json.loads(line)["off"]  # type: ignore[no-any-return]
    return f"crashes ({done.returncode})"


def main() -> None:
    """One trial."""
    fmu, inputs, name = sys.argv[1:]
    logging.disable()
    off: float | str
    with tempfile.TemporaryDirectory() as folder:
        try:
            off = float(np.abs(TRIALS[name](bench_of(Path(fmu), folder), np.load(inputs))).max())
        except Exception as error:  # of somebody else's FMU: whatever it is
            off = f"{type(error).__name__}: {error}".split("\n")[0][:60]
        print(json.dumps({"off": off}), flush=True)


if __name__ == "__main__":
    main()
