"""Energy of a motion as a model predicts it, with its parts by cause."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.augmented import ORIGIN, Augmented
from acqd.models.causes import parts_of_recording, require_parts
from acqd.models.effects.cause import Cause
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid
from acqd.models.predictor import Predictor, Recorded
from acqd.motion.controller import RATE, Motion

COLD = "thermal_friction"
"""The effect of cold gears."""


@dataclass(frozen=True, slots=True, eq=False)
class Use:
    """What a motion uses."""

    seconds: float
    causes: dict[Cause, float]
    """J of every cause."""
    power: Floats
    """[T] W at the model's step."""

    @property
    def energy(self) -> float:
        """J."""
        return sum(self.causes.values())


class Meter:
    """The model, asked about motions that nobody has recorded. The gears are warm: effects of the clock are 0."""

    def __init__(self, model: Predictor, name: object) -> None:
        require_parts(model, name)
        self.model = model
        self._every = round(model.step_s * RATE)

    def use(self, motion: Motion, start_s: float | None = None) -> Use:
        """Of a whole motion; the last row counts as far as the motion lasts.

        `start_s`: Unix time, for effects that follow the clock.
        """
        rows = -(-len(motion) // self._every)
        at = np.minimum(np.arange(rows + 1) * self._every, len(motion) - 1)
        known = {"brake": motion.brake_open[at] * 1.0, "tool": motion.tool_on[at] * 1.0}
        usual = dict(zip(self.model.signals, self.model.usual_signals(), strict=True))
        signals = np.column_stack(
            [np.zeros((len(at), 0)), *(known.get(name, np.full(len(at), usual[name])) for name in self.model.signals)]
        )
        parts = parts_of_recording(self.model, Recorded(motion.q[at], signals, start_s), len(at))
        weight = np.full(len(at), self.model.step_s)
        weight[rows - 1], weight[rows] = (len(motion) - (rows - 1) * self._every) / RATE, 0.0
        causes: dict[Cause, float] = {}
        for part in parts:
            causes[part.cause] = causes.get(part.cause, 0.0) + float(weight @ part.power)
        power = np.asarray(np.sum([part.power for part in parts], axis=0))
        return Use(motion.seconds, causes, power[:rows])

    @cached_property
    def grey(self) -> GreyBox:
        """The grey box in the model: it chooses time laws, and the whole model judges them."""
        base = self.model.base if isinstance(self.model, Augmented) else self.model
        base = base.grey if isinstance(base, Hybrid) else base
        if not isinstance(base, GreyBox):
            raise UserError("the model has no grey box")
        return base

    def holding(self, positions: Floats) -> Floats:
        """[T] W of the drives that hold the arm at positions [T, axes] with open brakes."""
        still = np.zeros_like(positions)
        return self.grey.drive_power(self.grey.rigid_torque(positions, still, still), still, still)

    @property
    def knows_brakes(self) -> bool:
        """Whether the model has learned what closed brakes save."""
        return "brake" in self.grey.signals

    def cold_starts(self) -> list[float]:
        """Unix times of the starts of sessions with cold gears that the loop has found; empty without that effect."""
        terms = self.model.terms if isinstance(self.model, Augmented) else []
        cold = [term.shape for term in terms if term.id == COLD]
        return [value for shape in cold for key, value in shape.items() if key.startswith(ORIGIN)]

    def with_mass(self, kg: float) -> Meter:
        """The same robot with another mass at the flange, a negative one for less."""
        grey, values = self.grey, self.grey.values.copy()
        x, y, z = kg * grey.chain.tip[0]
        at = grey.chain.tip[0]
        inertia = kg * (at @ at * np.eye(3) - np.outer(at, at))
        last = values[grey.layout.part("inertial")][-10:]
        last += [kg, x, y, z, *inertia[(0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)]]
        heavier: Predictor = GreyBox(grey.chain, grey.layout, values, grey.step_s, grey.usual_signals())
        base = self.model.base if isinstance(self.model, Augmented) else self.model
        if isinstance(base, Hybrid):
            raise UserError("--payload needs a grey box: the network of a hybrid has learned one payload")
        if isinstance(self.model, Augmented):
            heavier = Augmented(heavier, self.model.carrier, self.model.terms)
        return Meter(heavier, "the model")
