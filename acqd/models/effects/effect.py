"""What an effect is to the tracer: columns that are linear in its parameters, for a few shapes and places."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Lag, Scene, averaged

Shape: TypeAlias = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number that is fitted."""

    name: str
    unit: str
    low: float = -np.inf
    """What it cannot fall below, physically."""
    high: float = np.inf


@dataclass(frozen=True, slots=True)
class Place:
    """Where an effect can act, and with which numbers."""

    where: str
    """`joint 2`, `all joints`, `cabinet` ..."""
    columns: tuple[int, ...]
    """Of the columns that `Effect.at` gives."""
    parameters: tuple[Parameter, ...]
    """One per column, or per column of `mix`."""
    mix: Floats | None = None
    """[columns, parameters]: when a parameter acts on several columns in fixed proportions."""


@dataclass(frozen=True, slots=True)
class Variant:
    """One way in which an effect can be there: a place and a shape."""

    place: Place
    columns: tuple[int, ...]
    """Of the effect's own columns, all shapes together."""
    shape: Shape = field(default_factory=dict)
    """Parameters that are not linear, as they were scanned."""

    @property
    def size(self) -> int:
        """Parameters."""
        return len(self.place.parameters)


class Effect(ABC):
    """One physical effect. Adding one is one class in one file of `acqd.models.effects`."""

    id: ClassVar[str]
    summary: ClassVar[str]
    """One sentence for a plant engineer."""
    equation: ClassVar[str]
    neighbours: ClassVar[tuple[str, ...]] = ()
    """Effects that it is confused with."""
    experiment: ClassVar[str]
    """What to record to tell it from them."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Signals or channels without which it cannot be seen."""
    stage: ClassVar[Literal["load", "meter"]] = "load"
    """Whether the supply's lag comes after it (columns [SUB T, k]) or not ([T, k])."""
    by_torque: ClassVar[bool] = False
    """Whether it is a torque at the motors, so that its power also has a part that grows with its square."""
    predictable: ClassVar[bool] = True
    """Whether angles, signals and the clock tell when it acts, so that a model with it predicts better."""
    structural: ClassVar[bool] = True
    """Whether it is something that a model may lack from the start, in every recording alike."""

    shapes: ClassVar[tuple[Shape, ...]] = ({},)
    """What is scanned of parameters that are not linear."""
    bounds: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Of those parameters, for what is found to be refined between the scanned values."""

    @abstractmethod
    def at(self, scene: Scene, shape: Shape) -> Floats:
        """W per unit parameter: [SUB T, k] before the supply's lag, or [T, k] for the stage "meter"."""

    @abstractmethod
    def places(self, scene: Scene) -> Iterator[Place]:
        """Where it can act; `scene` is any one of the recordings."""

    def columns(self, scene: Scene) -> Floats:
        """All shapes side by side; each begins with the memory that the scene had."""
        memory = dict(scene.memory)
        found = []
        for shape in self.shapes:
            scene.memory.update(memory)
            found.append(self.at(scene, shape))
        return np.column_stack(found)

    def variants(self, scene: Scene) -> Iterator[Variant]:
        """Shapes and places to try."""
        width = self.at(scene, self.shapes[0]).shape[1]
        for number, shape in enumerate(self.shapes):
            for place in self.places(scene):
                yield Variant(place, tuple(number * width + k for k in place.columns), shape)

    def possible(self, scene: Scene) -> bool:
        """Whether the recordings have what it needs."""
        have = set(scene.signals)
        if scene.volts is not None:
            have.add("Vrms")
        if scene.temperature is not None:
            have.add("temperature")
        return set(self.needs) <= have


def effect_rows(effect: Effect, scene: Scene, shape: Shape | None = None) -> Floats:
    """[T, k] W at the meter per unit parameter, of one shape, or of all side by side.

    The scene's memory is left as it was: a scan looks at the same rows again and again.
    """
    memory = dict(scene.memory)
    columns = effect.columns(scene) if shape is None else effect.at(scene, shape)
    scene.memory.clear()
    scene.memory.update(memory)
    if effect.stage == "meter" or not columns.shape[1]:
        return columns[: scene.rows]
    return averaged(Lag(float(scene.model.group("lag")[0]), scene.step_s).run(columns))


def effect_rows_at(
    effect: Effect, scene: Scene, shape: Shape, columns: tuple[int, ...], coefficients: Floats
) -> Floats:
    """[T, k] W per unit parameter of some columns, such that times `coefficients` it is the power exactly there."""
    chosen = list(columns)
    if effect.by_torque:
        scene = scene.with_secant_slope(_torque(effect, scene, shape, chosen, coefficients))
    return effect_rows(effect, scene, shape)[:, chosen]


def _torque(effect: Effect, scene: Scene, shape: Shape, columns: list[int], coefficients: Floats) -> Floats:
    """[N, axes] Nm."""
    memory = dict(scene.memory)
    found = []
    for joint in range(scene.axes):
        scene.memory.clear()
        scene.memory.update(memory)
        found.append(effect.at(scene.unit_torque(joint), shape)[:, columns] @ coefficients)
    scene.memory.clear()
    scene.memory.update(memory)
    return np.column_stack(found)


def per_joint(
    axes: int, name: str, unit: str, nominal: Floats | None = None, first: int = 0, low: float = -np.inf
) -> Iterator[Place]:
    """Each joint alone, all of them in the proportions of `nominal`, and all of them freely."""
    for k in range(axes):
        yield Place(f"joint {k + 1}", (first + k,), (Parameter(name, unit, low),))
    everywhere = tuple(range(first, first + axes))
    if nominal is not None and nominal.any():
        even = bool((nominal == nominal[0]).all())
        common = Parameter(name, unit, low) if even else Parameter(f"{name}, relative", "-", -1.0)
        yield Place("all joints", everywhere, (common,), (nominal / (nominal[0] if even else 1.0))[:, None])
    yield Place("each joint", everywhere, tuple(Parameter(f"{name} joint {k + 1}", unit) for k in range(axes)))


def since(events: Floats, scene: Scene, name: str, before: float = np.inf) -> Floats:
    """[N] s since the last fine point where `events` is not 0; remembered in the scene's memory as `name`."""
    at = np.arange(len(events))
    last = np.maximum.accumulate(np.where(events != 0, at, -1))
    earlier = float(scene.memory.get(name, before))
    found = np.where(last >= 0, (at - last) * scene.substep_s, earlier + (at + 1) * scene.substep_s)
    scene.memory[name] = float(found[-1])
    return np.asarray(found)


def edges(switch: Floats, scene: Scene, name: str) -> tuple[Floats, Floats]:
    """[N] 1 where a 0/1 signal has just risen, and where it has fallen."""
    before = float(scene.memory.get(name, switch[0]))
    change = np.diff(switch, prepend=before)
    scene.memory[name] = float(switch[-1])
    return (change > 0.5).astype(float), (change < -0.5).astype(float)


def bins(age: Floats, limits: tuple[float, ...]) -> Floats:
    """[N, len - 1] 1 while the age lies within each interval."""
    inside = [(age >= low) & (age < high) for low, high in itertools.pairwise(limits)]
    return np.column_stack(inside).astype(np.float64)
