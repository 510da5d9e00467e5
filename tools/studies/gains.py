"""Whether intervals of a payload hold the true mass where the torque constants of a description are wrong (simulated).

    python -m tools.studies.gains OUT [--cases 60] [--error 0.1] [--plants 1001] [--show]

Plants are those of `tools.studies.foreign`: their masses, rotors and windings differ from the description by 10 to
20 %. In addition, the torque constants of the description are wrong by `--error`: all of a plant too large, all too
small, or each joint by a sign of its own. Every plant has a session without a payload, one with a known mass, and
three with a hidden one. Even plants log motor currents, odd ones angles only. Every hidden mass gets two intervals:
by the description, and by `acqd robot calibrate` with the known mass. Results in OUT are not computed again.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from acqd.dataset.build import BuildConfig, build
from acqd.discrepancy.calibrate import calibrate
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.recordings import subject_of
from acqd.discrepancy.repair.terms import reported
from acqd.discrepancy.repair.torque_scale import KEY, TorqueScale, torque_scale
from acqd.discrepancy.search import search
from acqd.errors import UserError
from acqd.models.bundle.bundle import load_bundle
from acqd.models.config import TrainConfig
from acqd.models.training import train_one
from acqd.report.digits import percent
from tools.common.tables import show
from tools.studies.foreign.generator.arm import DESCRIPTIONS
from tools.studies.foreign.generator.dosing import dosed
from tools.studies.foreign.generator.hidden.effect import Dose
from tools.studies.foreign.generator.hidden.mechanical import payload
from tools.studies.foreign.generator.motion import Plan
from tools.studies.foreign.generator.plant import Plant, Session
from tools.studies.foreign.generator.recordings import Clock, write

ROBOTS = ("ur10e", "iiwa7_r800", "ur3e", "kinova_gen3")
HIDDEN = 3
"""Payloads of each plant."""
_PLAN = Plan(5, 40.0)
_STRENGTH = 0.1
"""RMS of the payload's power over the dynamic range."""
_START_S = 1_767_600_000.0
_TARGET = 0.93
_WIDTH = 120


@dataclass(frozen=True, slots=True)
class Case:
    """One plant with a description whose torque constants are wrong."""

    out: Path
    seed: int
    error: float

    @property
    def robot(self) -> str:
        """Name of the shipped description."""
        return ROBOTS[self.seed % len(ROBOTS)]

    @property
    def torques(self) -> bool:
        """Motor currents are logged; a robot with torque sensors would not need the constants."""
        return self.seed // len(ROBOTS) % 2 == 0 and self.robot in ("ur10e", "ur3e")

    def factors(self, joints: int) -> np.ndarray:
        """[joints] torque constants of the description over the true ones."""
        random = np.random.default_rng([self.seed, 17])
        common = self.seed % 3
        signs = random.choice([-1.0, 1.0], joints) if common == 2 else np.full(joints, 1.0 - 2.0 * common)
        return np.asarray(1 + self.error * signs)

    def plant(self) -> Plant:
        """The true plant."""
        return Plant.drawn(self.robot, self.seed, signals=False)

    def description(self, plant: Plant) -> Path:
        """The shipped description with wrong torque constants; that its masses may be 20 % wrong is said."""
        path = self.out / f"{self.robot}.toml"
        text = (DESCRIPTIONS / path.name).read_text().replace("mass_deviation = 0.1", "mass_deviation = 0.2")
        true = iter(plant.arm.torque_per_ampere * self.factors(plant.arm.joints))

        def wrong(drive: re.Match[str]) -> str:
            ratio = float(drive["ratio"])
            return f"{drive['before']}torque_constant_Nm_A = {next(true) / ratio:.6g}"

        pattern = r"(?P<before>gear_ratio = (?P<ratio>[\d.]+),.*?)torque_constant_Nm_A = [\d.]+"
        path.write_text(re.sub(pattern, wrong, text))
        return path


def run(case: Case) -> list[dict[str, Any]]:
    """Results of the hidden payloads of one plant."""
    done = case.out / "results.json"
    if done.exists():
        return list(json.loads(done.read_text()))
    shutil.rmtree(case.out, ignore_errors=True)
    case.out.mkdir(parents=True)
    plant = case.plant()
    robot = case.description(plant)
    before, _ = _recorded(case, plant, robot, "before", 0)
    bundle = case.out / "model"
    train_one(TrainConfig(before, "grey-box", bundle), _quiet)
    calibrated, known_kg = _calibrated(case, plant, robot, bundle)
    results = []
    for number in range(HIDDEN):
        data, mass = _recorded(case, plant, robot, f"hidden-{number}", 1 + number, loaded=True)
        results.append(_judged(case, data, bundle, mass, calibrated) | {"known_kg": known_kg})
    for folder in case.out.iterdir():
        if folder.is_dir():
            shutil.rmtree(folder)
    done.write_text(json.dumps(results))
    return results


def _recorded(
    case: Case, plant: Plant, robot: Path, name: str, number: int, *, loaded: bool = False
) -> tuple[Path, float]:
    """Dataset of a session, and the mass at the flange."""
    random = np.random.default_rng([case.seed, number])
    session = Session.drawn(plant, _PLAN, random)
    doses: list[Dose] = []
    if loaded:
        doses = [dosed(session, payload(session, random), _STRENGTH)[0]]
    files = case.out / f"{name}.files"
    write(session, doses, files, _START_S + 86_400.0 * number, Clock(), torques=case.torques, random=random)
    data = case.out / name
    build(BuildConfig(str(files / "power.csv"), files / "logs", data, str(robot), lag_s=0.0), _quiet)
    shutil.rmtree(files)
    return data, doses[0].size if doses else 0.0


def _calibrated(case: Case, plant: Plant, robot: Path, bundle: Path) -> tuple[TorqueScale | None, float]:
    """The scale that a known mass gives, and the mass; None where acqd says that the mass does not show."""
    data, known_kg = _recorded(case, plant, robot, "known", 9, loaded=True)
    out = case.out / "calibrated"
    try:
        calibrate(CloseConfig(data, bundle, out), known_kg, _quiet)
    except UserError:
        return None, known_kg
    found = load_bundle(out).metadata[KEY]
    return TorqueScale(found["value"], found["deviation"]), known_kg


def _judged(
    case: Case, data: Path, bundle: Path, mass: float, calibrated: TorqueScale | None
) -> dict[str, Any]:  # fmt: skip
    config = CloseConfig(data, bundle, case.out / "loop")
    subject = subject_of(config, _quiet)
    _, selection = search(config, subject, _quiet)
    found = [each for each in selection.effects if each.id == "payload"]
    result: dict[str, Any] = {
        "robot": case.robot, "seed": case.seed, "currents": case.torques, "mass_kg": mass,
        "effects": [each.id for each in selection.effects],
    }  # fmt: skip
    scales = {"described": torque_scale(subject), "calibrated": calibrated}
    for name, scale in scales.items():
        if not found or scale is None:
            result[name] = None
            continue
        own = reported(selection, found[0], scale).term.parameters["mass"]
        result[name] = {"value": own["value"], "ci95": own["ci95"], "scale": scale.value, "deviation": scale.deviation}
    return result


def _quiet(*_progress: object) -> None:
    """No progress."""


def holds(result: dict[str, Any], scale: str) -> bool | None:
    """Whether the interval holds the true mass; None without an interval."""
    found = result[scale]
    if not found:
        return None
    low, high = found["ci95"]
    return bool(low <= result["mass_kg"] <= high)


def tables(results: list[dict[str, Any]]) -> Table:
    """By robot and log: how many intervals hold the truth, and how wide they are."""
    table = Table(
        "robot", "log", "hidden", "named", "described: hold", "half width", "error", "calibrated: hold",
        "half width", "error", title=f"95 % intervals of a payload, torque constants wrong (target {percent(_TARGET)})",
    )  # fmt: skip
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for each in results:
        groups.setdefault((each["robot"], "currents" if each["currents"] else "angles"), []).append(each)
    for (robot, log), some in [*sorted(groups.items()), (("all", ""), results)]:
        named = [each for each in some if each["described"]]
        cells = [cell for scale in ("described", "calibrated") for cell in _cells(named, scale)]
        table.add_row(robot, log, str(len(some)), str(len(named)), *cells)
    return table


def _cells(named: list[dict[str, Any]], scale: str) -> list[str]:
    some = [each for each in named if each[scale]]
    if not some:
        return ["-", "-", "-"]
    held = sum(bool(holds(each, scale)) for each in some)
    masses = np.array([each["mass_kg"] for each in some])
    low, high = np.array([each[scale]["ci95"] for each in some]).T
    errors = np.array([each[scale]["value"] for each in some]) / masses - 1
    return [
        f"{held} of {len(some)} ({percent(held / len(some))})",
        percent(np.median((high - low) / 2 / masses)),
        percent(np.sqrt((errors**2).mean())),
    ]


def main() -> None:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, default=60, help=f"hidden payloads, {HIDDEN} a plant (default 60)")
    parser.add_argument("--error", type=float, default=0.1, help="of the torque constants (default 0.1)")
    parser.add_argument("--plants", type=int, default=1001, metavar="SEED", help="seed of the first plant")
    parser.add_argument("--show", action="store_true", help="only the table of the results in OUT")
    given = parser.parse_args()
    console = Console(stderr=True)
    results: list[dict[str, Any]] = []
    for seed in range(given.plants, given.plants - (-given.cases // HIDDEN)):
        case = Case(given.out.resolve() / f"plant-{seed}", seed, given.error)
        if given.show and not (case.out / "results.json").exists():
            continue
        results += run(case)
        console.print(f"plant {seed} of {case.robot}: {len(results)} of {given.cases}", highlight=False)
    show(tables(results), width=_WIDTH)


if __name__ == "__main__":
    main()
