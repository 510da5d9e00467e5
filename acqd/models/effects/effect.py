"""A physical effect: columns linear in its parameters in numpy, the same expression in C, and all its properties."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.places import Place, Shape, Variant, in_units_of
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import Lag
from acqd.models.greybox.model import GreyBox

ActsOn = Literal["torque", "load", "meter", "clock"]
"""Torque at the motors; power before the supply's lag; metered power; time axis of the metered power."""
Detector = Literal["", "ripple", "rhythm", "bursts", "contact"]
"""Search in the residual that provides an effect's columns; "": motion, signals and clock determine them."""


class Effect(ABC):
    """A physical effect that a model may lack. A new effect is a new class in a new file in `catalogue`."""

    id: ClassVar[str]
    """Name in reports, bundles and FMUs; also the name of the file."""
    cause: ClassVar[Cause]
    """Group to which the effect's power belongs."""
    summary: ClassVar[str]
    """A sentence for a plant engineer."""
    equation: ClassVar[str]
    experiment: ClassVar[str]
    """Recordings that distinguish the effect from its neighbours."""
    usual: ClassVar[str] = ""
    """Group of the grey box that has the usual value of the effect's quantity: of a joint, or of the robot."""
    neighbours: ClassVar[tuple[str, ...]] = ()
    """Ids of effects that are easily confused with this one."""
    acts_on: ClassVar[ActsOn] = "load"
    at_link: ClassVar[bool] = False
    """A torque that a sensor behind the gear sees too; friction is before the gear."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Signals or channels without which the effect cannot be observed."""
    predictable: ClassVar[bool] = True
    """Motion, signals and the clock determine when the effect acts, so that a model with it predicts better."""
    structural: ClassVar[bool] = True
    """A model may lack the effect from the start, in every recording alike."""
    simplification: ClassVar[float] = 0.0
    """Relative standard deviation of the columns by what the equation leaves out."""
    of_drives: ClassVar[bool] = False
    """A law of the drives' whole power: other effects' power passes through the same law."""
    follows_clock: ClassVar[bool] = False
    """Depends on the time since the start of the session; a term keeps that time as `origin_s`."""
    known_mass: ClassVar[bool] = False
    """Whether a mass that is known beforehand has this effect: such a mass calibrates guessed drives."""
    detected: ClassVar[Detector] = ""
    restores: ClassVar[tuple[str, ...]] = ()
    """Groups of grey-box parameters that describe the effect: a grey box without them lacks the effect."""

    shapes: ClassVar[tuple[Shape, ...]] = ({},)
    """Scanned values of the shape."""
    bounds: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Range of a shape parameter that is refined between scanned values."""

    exported: ClassVar[bool] = True
    """An FMU can hold the effect."""
    omitted_because: ClassVar[str] = ""
    """Why an FMU does not hold the effect."""
    c_body: ClassVar[str] = ""
    """C statements for one row at LANES substeps at once; `acqd/fmu/c/lanes.h` has the variables in scope."""

    @abstractmethod
    def at(self, scene: Scene, shape: Shape) -> Floats:
        """W per unit of each parameter: [N, k] before the supply's lag, or [T, k] for "meter" and "clock"."""

    def some(self, scene: Scene, shape: Shape, columns: Sequence[int] | slice) -> Floats:
        """Some columns of `at`; another one where they take less than all of them."""
        return self.at(scene, shape)[:, columns]

    def torque(self, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats) -> Floats:
        """[N, axes] Nm at the motors of an effect of torques with the `coefficients` [k] of chosen columns.

        A column is linear in the power per torque: with 1 W/Nm at one joint, it is the torque there.
        """
        chosen, memory, torque = list(columns), dict(scene.memory), []
        for joint in range(scene.axes):
            scene.memory.clear()
            scene.memory.update(memory)
            torque.append(self.at(scene.unit_torque(joint), shape)[:, chosen] @ coefficients)
        scene.memory.clear()
        scene.memory.update(memory)
        return np.column_stack(torque)

    @abstractmethod
    def places(self, scene: Scene) -> Iterator[Place]:
        """Places where the effect can act; none for a detected effect. `scene`: any of the recordings."""

    def remembered(self, scene: Scene, shape: Shape, rows: int) -> dict[str, Any]:
        """What the scene's memory holds after `rows` (at least 1), for a scene that starts there; {} for nothing."""
        return {}

    def lever(self, model: GreyBox, place: Place, shape: Shape) -> float | None:
        """m from the last axis to the mass that the first coefficient is: mass times lever may be better known."""
        return None

    def simplified(self, place: Place) -> float:
        """Relative standard deviation of the columns at a place, by what the equation leaves out."""
        return self.simplification

    def detected_place(self, shape: Shape, model: GreyBox) -> Place:
        """Place of a detected effect in the arm of `model`. Raises NotImplementedError for other effects."""
        raise NotImplementedError(f"{self.id} is not detected in the residual")

    def fixed_shape(self, scenes: Sequence[Scene]) -> dict[str, float]:
        """Shape parameters that the recordings determine without a search, for a term to keep."""
        return {}

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Constants of `c_body` by name: scalars and arrays."""
        return {name: float(value) for name, value in shape.items() if name in self.shapes[0]}

    def assumption(self, shape: Shape) -> str:
        """What an FMU with a term of this shape assumes, as a sentence for the user; "" for nothing."""
        return ""

    def signals_of(self, columns: Sequence[int]) -> set[str]:
        """Signals that some of the columns need."""
        return set(self.needs)

    def columns(self, scene: Scene) -> Floats:
        """Columns of all shapes side by side; every shape starts with the memory of the scene."""
        memory = dict(scene.memory)
        blocks = []
        for shape in self.shapes:
            scene.memory.update(memory)
            blocks.append(self.at(scene, shape))
        return np.column_stack(blocks)

    def variants(self, scene: Scene) -> Iterator[Variant]:
        """All combinations of shapes and places."""
        width = self.at(scene, self.shapes[0]).shape[1]
        for number, shape in enumerate(self.shapes):
            for place in self.places(scene):
                columns = tuple(number * width + k for k in place.columns)
                yield Variant(in_units_of(place, scene.model.layout.sliding), columns, shape)

    def possible(self, scene: Scene) -> bool:
        """Whether the recording has what the effect needs."""
        have = set(scene.signals)
        if scene.volts is not None:
            have.add("Vrms")
        if scene.temperature is not None:
            have.add("temperature")
        return set(self.needs) <= have


def effect_rows(
    effect: Effect, scene: Scene, shape: Shape | None = None, chosen: Sequence[int] | slice = slice(None)
) -> Floats:
    """[T, k] W at the meter per unit parameter of `chosen` columns of one shape, or of all shapes side by side.

    The scene's memory is left unchanged, because a scan visits the same rows several times.
    """
    memory = dict(scene.memory)
    columns = effect.columns(scene)[:, chosen] if shape is None else effect.some(scene, shape, chosen)
    scene.memory.clear()
    scene.memory.update(memory)
    if effect.acts_on in ("meter", "clock") or not columns.shape[1]:
        return columns[: scene.rows]
    return Lag(float(scene.model.group("lag")[0]), scene.step_s).means(columns)


def effect_rows_at(effect: Effect, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats) -> Floats:
    """[T, k] W per unit parameter of chosen columns; times `coefficients` [k], the exact power (secant slope)."""
    chosen = list(columns)
    if effect.acts_on == "torque":
        scene = scene.with_secant_slope(effect.torque(scene, shape, chosen, coefficients))
    return effect_rows(effect, scene, shape, chosen)


def torque_rows_by_joint(
    effect: Effect, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats
) -> Floats:
    """[T, axes] W at the meter of an effect of torques, by joint: power is linear in the power per torque."""
    chosen = list(columns)
    moved = scene.with_secant_slope(effect.torque(scene, shape, chosen, coefficients))
    joints = np.eye(scene.axes)
    rows = [
        effect_rows(effect, replace(moved, power_per_torque=moved.power_per_torque * joint, computed={}), shape, chosen)
        for joint in joints
    ]
    return np.column_stack([each @ coefficients for each in rows])


def drive_power(effect: Effect, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats) -> Floats:
    """[N] W at the drives of an effect of torques with the `coefficients` [k] of chosen columns."""
    chosen = list(columns)
    moved = scene.with_secant_slope(effect.torque(scene, shape, chosen, coefficients))
    memory = dict(scene.memory)
    power = effect.some(moved, shape, chosen) @ coefficients
    scene.memory.clear()
    scene.memory.update(memory)
    return np.asarray(power)
