"""Which cases the study has, and their files: plants, sessions before, sessions after with hidden effects."""

from __future__ import annotations

import copy
import json
import math
import os
import shutil
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.studies.foreign.generator.dosing import dosed
from tools.studies.foreign.generator.hidden.catalogue import ALL, CLOCKS, ELECTRICAL, MECHANICAL, NEED_SIGNALS, OUTSIDE
from tools.studies.foreign.generator.hidden.effect import Dose
from tools.studies.foreign.generator.motion import STEP_S, Motion, Plan
from tools.studies.foreign.generator.plant import Plant, Session
from tools.studies.foreign.generator.recordings import Clock, log_name, write

ROBOTS = {7: "iiwa7_r800", 6: "ur10e"}
PLANS = {
    "full": (Plan(10, 120.0), Plan(8, 120.0)),
    "short": (Plan(5, 60.0), Plan(5, 60.0)),
    "brief": (Plan(5, 60.0), Plan(4, 15.0)),
}
"""Recordings before and after; after brief ones many small effects stay open."""
STRENGTHS = (10, 3, 1)
"""Percent of the dynamic range."""
CLEAN = 6
"""Clean sets per plant."""
PAIRS = (
    ("payload", "coulomb_friction"), ("thermostat", "copper_loss"), ("viscous_friction", "offset_shift"),
    ("gravity_bias", "process_load"), ("line_voltage", "load_dependent_friction"), ("gear_ripple", "payload"),
    ("supply_efficiency", "coulomb_friction"), ("contact_force", "viscous_friction"),
    ("brake_release", "gravity_bias"), ("tool_actuation", "copper_loss"),
)  # fmt: skip
_BEFORE_S = 1_767_600_000.0
"""Unix time of the sessions before."""


@dataclass(frozen=True, slots=True)
class World:
    """A plant and how its recordings are made."""

    axes: int
    seed: int
    amount: str
    torques: bool
    own_clocks: bool
    harsh: bool = False
    """At a site that shares no assumption with acqd (`generator.site`)."""
    arm: str = ""
    """A shipped description, for another robot than the usual one of that number of axes."""

    @property
    def name(self) -> str:
        """Folder of its files."""
        extras = ["torque"] * self.torques + ["clocks"] * self.own_clocks + ["harsh"] * self.harsh
        return "-".join([self.arm or f"axes{self.axes}", self.amount, *extras, f"seed{self.seed}"])

    @property
    def robot(self) -> str:
        """Description that acqd is given."""
        return self.arm or ROBOTS[self.axes]

    def plant(self) -> Plant:
        """The true plant."""
        return Plant.drawn(self.robot, self.seed, signals=self.axes == 7, harsh=self.harsh)


@dataclass(frozen=True, slots=True)
class Case:
    """A session after, with hidden effects at a strength in percent (0 for a clean one)."""

    name: str
    effects: tuple[str, ...]
    strength: int


def cases(axes: int, strengths: tuple[int, ...], *, own_clocks: bool = False) -> list[Case]:
    """All cases of a plant: clean ones, single effects, effects outside of the library, pairs.

    Clocks that the alignment has to find hide no clock effects: it would rightly remove them.
    """
    missing = (*(() if axes == 7 else NEED_SIGNALS), *(CLOCKS if own_clocks else ()))
    known = [name for name in MECHANICAL | ELECTRICAL if name not in missing]
    found = [Case(f"clean-{number}", (), 0) for number in range(1, CLEAN + 1)]
    for strength in strengths:
        found += [Case(f"{name}-{strength}", (name,), strength) for name in [*known, *OUTSIDE]]
        pairs = [pair for pair in PAIRS if not set(pair) & set(missing)]
        found += [Case(f"{'+'.join(pair)}-{strength}", pair, strength) for pair in pairs if strength > 1]
    return found


def make_before(world: World, folder: Path) -> Path:
    """Files of the session before."""
    if not folder.exists():
        plant, random = world.plant(), np.random.default_rng([world.seed, 0])
        plan = plant.site.plan(PLANS[world.amount][0], after=False)
        _write(world, Session.drawn(plant, plan, random), [], folder, random, _BEFORE_S, {})
    return folder


def make_after(world: World, case: Case, folder: Path) -> dict[str, Any]:
    """Files of a session after, and the truth about it."""
    if not folder.exists():
        random = np.random.default_rng([world.seed, zlib.crc32(case.name.encode())])
        plant = world.plant()
        session = Session.drawn(plant, plant.site.plan(PLANS[world.amount][1], after=True), random)
        scaled = [dosed(session, ALL[name](session, random), case.strength / 100) for name in case.effects]
        truth = {"effects": [_truth(dose, reached) for dose, reached in scaled]}
        _write(world, session, [dose for dose, _ in scaled], folder, random, _later(random), truth)
    return dict(json.loads((folder / "truth.json").read_text()))


def make_second(
    world: World, case: Case, folder: Path, truth: dict[str, Any], name: str, motion: Motion | Plan,
    worked_min: float = 0.0,
) -> Path:  # fmt: skip
    """Files of one more session, an hour after the one of `make_after`: the same effects in the same sizes.

    `worked_min`: of work before the session, in which the friction of cold gears has decayed.
    """
    if not folder.exists():
        random = np.random.default_rng([world.seed, zlib.crc32(case.name.encode())])
        plant = world.plant()
        first = Session.drawn(plant, plant.site.plan(PLANS[world.amount][1], after=True), random)
        own = np.random.default_rng([world.seed, zlib.crc32(f"{case.name} {name}".encode())])
        second = Session.drawn(plant, motion, own) if isinstance(motion, Plan) else Session.along(plant, motion, own)
        doses = []
        for effect, known in zip(case.effects, truth["effects"], strict=True):
            again = copy.deepcopy(random)  # an effect draws its place and shape first, and after that when it acts
            ALL[effect](first, random)
            hidden = ALL[effect](second, again)
            warmed = worked_min / hidden.details["minutes"] if effect == "thermal_friction" else 0.0
            doses.append(Dose(hidden, known["size"] * math.exp(-warmed)))
        folder.parent.mkdir(parents=True, exist_ok=True)
        start_s = _later(random) + float(first.motion.t[-1]) + 3600.0
        _write(world, second, doses, folder, own, start_s, {"effects": truth["effects"]})
    return folder


def _later(random: np.random.Generator) -> float:
    """Unix time of a session after."""
    return _BEFORE_S + 86_400.0 * float(random.integers(1, 120)) + float(random.uniform(0, 20_000))


def _truth(dose: Dose, reached: float) -> dict[str, Any]:
    effect = dose.effect
    return {
        "id": effect.id,
        "where": effect.place,
        "value": dose.truth,
        "unit": effect.unit,
        "size": dose.size,
        "strength": reached,
        "details": effect.details,
    }


def _write(
    world: World, session: Session, doses: list[Dose], folder: Path, random: np.random.Generator, start_s: float,
    truth: dict[str, Any],
) -> None:  # fmt: skip
    """The folder appears complete or not at all."""
    partial = folder.with_name(f"{folder.name}.{os.getpid()}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    clock = Clock()
    if world.own_clocks:
        clock = Clock(float(random.uniform(-1.8, 1.8)), float(random.normal(0, 12.0)))
    write(session, doses, partial, start_s, clock, torques=world.torques, random=random)
    middles = [(rows.start + rows.stop) / 2 * STEP_S for rows in session.motion.recordings]
    lags = {log_name(number): float(clock.read(np.array(t))) - t for number, t in enumerate(middles)}
    (partial / "truth.json").write_text(json.dumps(truth | {"clock": asdict(clock), "lags_s": lags}))
    partial.rename(folder)
