"""An independent importer (fmpy) in either version of FMI."""

from pathlib import Path

import numpy as np
import pytest

from acqd.fmu.variables import exported_terms
from acqd.models.augmented import Augmented
from tests.builders import AXES, STEP

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.fmi3 import FMU3Slave  # noqa: E402


def recording(rows=400, seed=1):
    """Angles, and what signals a model may ask for."""
    random = np.random.default_rng(seed)
    t = np.arange(rows) * STEP
    q = sum(a * np.sin(2 * np.pi * f * t[:, None] + p) for a, f, p in zip(
        random.uniform(0.2, 0.5, (3, AXES)), random.uniform(0.05, 0.4, (3, AXES)), random.uniform(0, 6, (3, AXES)),
        strict=True,
    ))  # fmt: skip
    brake = np.clip((np.arange(rows) - 30.3), 0, 1) * (np.arange(rows) < rows - 40)
    tool = ((np.arange(rows) // 70) % 2) * 1.0
    return q, {"brake": brake, "tool": tool, "Vrms": 230 + 3 * np.sin(t / 5)}


class Unit:
    """An instance in either version, through fmpy."""

    def __init__(self, file, folder, start=0.0):
        self.description = fmpy.read_model_description(str(file))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.folder = Path(folder)
        if not (self.folder / "binaries").exists():
            fmpy.extract(str(file), str(self.folder))
        self.two = self.description.fmiVersion == "2.0"
        common = {
            "guid": self.description.guid, "unzipDirectory": str(self.folder),
            "modelIdentifier": self.description.coSimulation.modelIdentifier, "instanceName": "one",
        }  # fmt: skip
        self.unit = FMU2Slave(**common) if self.two else FMU3Slave(**common)
        self.unit.instantiate()
        self.begin(start)

    def begin(self, start=0.0, **inputs):
        if self.two:
            self.unit.setupExperiment(startTime=start)
            self.unit.enterInitializationMode()
        else:
            self.unit.enterInitializationMode(startTime=start)
        self.set(**inputs)
        self.unit.exitInitializationMode()
        self.time = start

    def set(self, **inputs):
        reals = {self.references[name]: float(value) for name, value in inputs.items() if name != "reset"}
        put = self.unit.setReal if self.two else self.unit.setFloat64
        put(list(reals), list(reals.values()))
        if "reset" in inputs:
            (self.unit.setBoolean)([self.references["reset"]], [bool(inputs["reset"])])

    def step(self, seconds=STEP):
        if self.two:
            self.unit.doStep(self.time, seconds)
        else:
            self.unit.doStep(self.time, seconds)
        self.time += seconds

    def get(self, *names):
        take = self.unit.getReal if self.two else self.unit.getFloat64
        return take([self.references[name] for name in names])

    def close(self):
        self.unit.terminate()
        self.unit.freeInstance()


def inputs(model, q, signals, row):
    found = {f"q{k + 1}": q[row, k] for k in range(AXES)}
    return found | {name: signals[name][row] for name in model.signals}


def play(unit, model, q, signals, rows=None):
    """Power and energy after each step."""
    found = []
    for row in range(len(q)) if rows is None else rows:
        unit.set(**inputs(model, q, signals, row))
        unit.step()
        found.append(unit.get("power", "energy"))
    return np.array(found)


def expected(model, q, signals):
    columns = np.column_stack([np.zeros((len(q), 0)), *(signals[name] for name in model.signals)])
    if isinstance(model, Augmented):
        model = Augmented(model.base, model.carrier, exported_terms(model))
    return model.sequence(q, columns)
