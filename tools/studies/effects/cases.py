"""Cases: one plant, a reference campaign without effects, and test campaigns with one, two or none of them.

A case's strength is the RMS of the hidden power while the effect acts, as a share of the dynamic range (p99 - p1 of
the metered power). Shape parameters and places are drawn by the case's seed.
"""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.dataset.build import BuildConfig, build
from acqd.lab.campaign.folders import Folders
from acqd.lab.campaign.run_session import run_session
from acqd.lab.campaign.trajectory_set import draw, write
from acqd.lab.cell import build_cell
from acqd.lab.effects import EffectSpec, known_effects
from acqd.lab.schedule import RecordingPlan, SessionPlan, session_start_s
from acqd.lab.session import windows_within
from acqd.lab.settings import CampaignSettings
from tools.studies.effects.outside import OUTSIDE, register

NOT_IN_POWER = {"torque_bias": 30.0, "encoder_bias": 1.5}
"""Effects that the meter does not see, and how large they are at a strength of 1 (Nm, rad)."""
CLOCKS = ("clock_offset", "clock_drift")
_CLOCK_OFFSET_S = 1.24


@dataclass(frozen=True)
class World:
    """One plant with its trajectories."""

    robot: str
    seed: int
    folder: Path
    limited: int = 12
    all_space: int = 12
    assemblies: int = 8
    tests: int = 1
    """Number of test campaigns, with different trajectories."""

    @classmethod
    def of(cls, robot: str, seed: int, folder: Path, tests: int) -> World:
        """Only the iiwa has assemblies, where a tool switches."""
        return cls(robot, seed, folder, assemblies=8 if robot == "iiwa7_r800" else 0, tests=tests)

    def settings(self, effects: list[EffectSpec]) -> CampaignSettings:
        """Of all its campaigns."""
        clock = {"offset_s": _CLOCK_OFFSET_S, "drift_ppm": 0.0}
        return CampaignSettings.model_validate(
            {"robot": self.robot, "seed": self.seed, "effects": effects, "clock": clock, "session": self.size}
        )

    @property
    def size(self) -> int:
        """Recordings of a campaign."""
        return self.limited + self.all_space + self.assemblies

    def trajectories(self) -> None:
        """Draw them once."""
        folder = self.folder / "trajectories"
        if len(list(folder.glob("*.csv"))) >= (self.limited + self.all_space) * (1 + self.tests):
            return
        cell = build_cell(self.settings([]))
        many = 1 + self.tests
        write(draw(cell, limited=self.limited * many, all_space=self.all_space * many), cell, folder)

    def plan(self, test: int, share: float = 1.0) -> SessionPlan:
        """Session `test` (0: the reference), or the first `share` of each of its kinds."""
        kinds = [("limited", self.limited), ("all", self.all_space), ("assembly", self.assemblies)]
        chosen: list[tuple[str, int]] = []
        for kind, count in kinds:
            numbers = range(test * count + 1, test * count + 1 + max(1, round(share * count)) * (count > 0))
            chosen += [(kind, 0 if kind == "assembly" else number) for number in numbers]
        order = np.random.default_rng([self.seed, test, 77]).permutation(len(chosen))
        recordings = tuple(RecordingPlan(test * self.size + k + 1, *chosen[which]) for k, which in enumerate(order))
        start_s = session_start_s(self.settings([]), test * self.size + 1)
        return SessionPlan(0, test, start_s, recordings)


@dataclass(frozen=True)
class Case:
    """One test campaign."""

    name: str
    test: int
    effects: tuple[tuple[str, float], ...]
    """Effect and strength (share of the dynamic range)."""
    seed: int = 1


def drawn_parameters(effect: str, axes: int, random: np.random.Generator) -> dict[str, float]:
    """Shape and place, never the strength."""
    strong = (1, 2, 3, 4) if axes == 7 else (1, 2, 3)
    places = {
        "coulomb_friction", "viscous_friction", "stribeck_friction", "load_dependent_friction", "thermal_friction",
        "mechanical_power",
    }  # fmt: skip
    values: dict[str, float] = {}
    if effect in places:
        values["axis"] = float(random.choice([0, *strong]))
    if effect == "gear_ripple":
        values["axis"] = float(random.choice(strong))
    if effect == "encoder_bias":
        values["axis"] = float(random.choice(strong[1:]))  # gravity does not see joint 1
    if effect == "gravity_bias":
        values["axis"] = float(random.choice([3, 4] if axes == 7 else [2, 3]))
    ranges = {
        "stribeck_friction": {"speed_rad_s": (0.08, 0.25)},
        "thermal_friction": {"minutes": (6.0, 20.0)},
        "gear_ripple": {"periods": (6.0, 30.0)},
        "brake_release": {"tau_s": (0.06, 0.25), "pull_s": (0.1, 0.3)},
        "tool_actuation": {"pulse_s": (0.15, 0.5)},
        "thermostat": {"period_s": (60.0, 200.0), "duty": (0.3, 0.65)},
        "regeneration_clipping": {"above_W": (0.0, 5.0)},
        "mounting": {"towards_deg": (0.0, 360.0)},
        "outside_speed_band": {"speed_rad_s": (0.35, 0.6)},
        "outside_lagging_fan": {"tau_s": (8.0, 25.0)},
    }
    for name, (low, high) in ranges.get(effect, {}).items():
        values[name] = float(random.uniform(low, high))
    return values


def make_reference(world: World) -> Path:
    """The reference dataset."""
    world.trajectories()
    settings = world.settings([])
    folders = _folders(world, "reference")
    run_session(settings, world.plan(0), folders)
    return _dataset(world, folders, settings, test=0, clocks=False)


def make_case(world: World, case: Case) -> dict[str, Any]:
    """A test dataset; the truth is kept outside of the dataset."""
    register()
    truth_file = world.folder / "truth" / f"{case.name}.json"
    if truth_file.exists():
        return dict(json.loads(truth_file.read_text()))
    world.trajectories()
    axes = build_cell(world.settings([])).robot.axes
    random = np.random.default_rng([world.seed, case.seed, zlib.crc32(case.name.encode())])
    orders = []
    clean = world.settings([])
    base = _run(world, clean, case, "probe-clean", 0.2) if case.effects else None
    for effect, strength in case.effects:
        shape = drawn_parameters(effect, axes, random)
        orders.append(_scaled(world, case, effect, shape, strength, base))
    first = case.test * world.size + 1
    settings = world.settings([order.model_copy(update={"recording": first}) for order in orders])
    folders = _folders(world, case.name)
    report = run_session(settings, world.plan(case.test), folders)
    clocks = any(effect in CLOCKS for effect, _ in case.effects)
    dataset = _dataset(world, folders, settings, test=case.test, clocks=clocks)
    truth = {
        "name": case.name,
        "dataset": str(dataset),
        "effects": [{"id": o.id, "strength": s, "values": {**known_effects()[o.id].defaults, **o.values}}
                    for o, (_, s) in zip(orders, case.effects, strict=True)],
        "hidden_W": [r["hidden_W"] for r in report["recordings"]],
    }  # fmt: skip
    truth_file.parent.mkdir(parents=True, exist_ok=True)
    truth_file.write_text(json.dumps(truth))
    return truth


def _scaled(
    world: World, case: Case, effect: str, shape: dict[str, float], strength: float, base: tuple[Floats, Floats] | None
) -> EffectSpec:
    """The order whose hidden power has the strength, by secant steps on a short campaign."""
    cls = known_effects()[effect]
    key = cls.strength[0]
    assert base is not None
    power, range_W = base[0], float(np.ptp(np.percentile(base[0], [1, 99])))
    wanted = strength * range_W
    if effect in NOT_IN_POWER:
        return _order(effect, shape | {key: NOT_IN_POWER[effect] * strength})
    if effect == "meter_saturation":
        return _saturation(world, case, shape, wanted, base)
    if effect in CLOCKS:
        slope = np.gradient(power, 0.04)
        seconds = wanted / float(np.sqrt((slope**2).mean()))
        length_s = 60.0 * (world.limited + world.all_space + world.assemblies)
        return _order(effect, shape | {key: seconds if effect == "clock_offset" else 2e6 * seconds / length_s})
    value = float(cls.defaults[key])
    low, high = cls.limits.get(key, (-1e6, 1e6))
    for _ in range(2):
        shape = _together(effect, cls.defaults, shape, value)
        found = _acting_rms(
            _run(world, world.settings([_order(effect, shape | {key: value})]), case, "probe", 0.2), base
        )
        if found < 1e-6:
            break
        value = float(np.clip(value * wanted / found, low, high))
    return _order(effect, _together(effect, cls.defaults, shape, value) | {key: value})


def _together(effect: str, defaults: Any, shape: dict[str, float], value: float) -> dict[str, float]:
    """Secondary powers that grow with the strength."""
    seconds = {"brake_release": ("pull_W", "peak_W"), "tool_actuation": ("pulse_W", "power_W")}
    if effect not in seconds:
        return shape
    second, first = seconds[effect]
    return shape | {second: defaults[second] / defaults[first] * value}


def _saturation(
    world: World, case: Case, shape: dict[str, float], wanted: float, base: tuple[Floats, Floats]
) -> EffectSpec:
    """Bisection on the limit."""
    low, high = 0.5, 5.0
    for _ in range(7):
        limit = (low + high) / 2
        order = _order("meter_saturation", shape | {"limit_A": limit})
        found = _acting_rms(_run(world, world.settings([order]), case, "probe", 0.2), base)
        low, high = (low, limit) if found < wanted else (limit, high)
    return _order("meter_saturation", shape | {"limit_A": (low + high) / 2})


def _order(effect: str, values: dict[str, float]) -> EffectSpec:
    return EffectSpec(id=effect, values=values, declared=False)


def _acting_rms(with_effect: tuple[Floats, Floats], without: tuple[Floats, Floats]) -> float:
    """RMS of the hidden power while it acts, from the true power, or from the metered power for faults of the meter."""
    size = min(len(with_effect[0]), len(without[0]))
    hidden = with_effect[1][:size]
    if np.abs(hidden).max() < 1e-6:
        hidden = with_effect[0][:size] - without[0][:size]
    if np.abs(hidden).max() < 1e-9:
        return 0.0
    acting = np.abs(hidden) > 0.05 * np.abs(hidden).max()
    return float(np.sqrt((hidden[acting] ** 2).mean()))


def _run(world: World, settings: CampaignSettings, case: Case, name: str, share: float) -> tuple[Floats, Floats]:
    """Metered power and hidden power [windows] (W) within the recordings of a short campaign."""
    folders = _folders(world, f"{name}-{case.name}")
    plan = world.plan(case.test, share)
    report = run_session(settings, plan, folders)
    with np.load(folders.truth / f"{plan.name}.npz") as arrays:
        metered, true, clean = arrays["P_metered_W"], arrays["P_W"], arrays["P_without_effects_W"]
        window_s = float(arrays["window_s"])
    within = [windows_within(r["start_s"], r["seconds"], window_s) for r in report["recordings"]]
    kept = np.concatenate([np.arange(part.start, part.stop) for part in within])
    kept = kept[kept < min(len(metered), len(true))]
    return metered[kept], (true - clean)[kept]


def _folders(world: World, name: str) -> Folders:
    out = world.folder / "campaigns" / name
    out.mkdir(parents=True, exist_ok=True)
    link = out / "trajectories"
    if not link.exists():
        link.symlink_to((world.folder / "trajectories").resolve())
    return Folders(out, world.folder / "truth" / "campaigns" / name)


def _dataset(world: World, folders: Folders, settings: CampaignSettings, *, test: int, clocks: bool) -> Path:
    """Built as a user would; with a clock effect by one who trusts the clocks."""
    plan = world.plan(test)
    rows = folders.work / f"{plan.name}.jsonl"
    out = world.folder / "datasets" / folders.out.name
    if not out.exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        lag = _CLOCK_OFFSET_S if clocks else None
        build(BuildConfig(str(rows), folders.out / "logs", out, settings.robot, lag_s=lag), lambda *_: None)
    return out


OUTSIDE_IDS = tuple(cls.id for cls in OUTSIDE)
