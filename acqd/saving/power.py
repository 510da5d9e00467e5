"""Energy of a motion as a model predicts it, with its parts by cause."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.augmented import Augmented
from acqd.models.causes import parts_of_recording, require_parts
from acqd.models.effects.cause import Cause
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid
from acqd.models.predictor import Predictor, Recorded
from acqd.motion.controller import RATE, Motion


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

    def use(self, motion: Motion) -> Use:
        """Of a whole motion; the last row counts as far as the motion lasts."""
        rows = -(-len(motion) // self._every)
        at = np.minimum(np.arange(rows + 1) * self._every, len(motion) - 1)
        known = {"brake": motion.brake_open[at] * 1.0, "tool": motion.tool_on[at] * 1.0}
        usual = dict(zip(self.model.signals, self.model.usual_signals(), strict=True))
        signals = np.column_stack(
            [np.zeros((len(at), 0)), *(known.get(name, np.full(len(at), usual[name])) for name in self.model.signals)]
        )
        parts = parts_of_recording(self.model, Recorded(motion.q[at], signals, None), len(at))
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

    def holding(self, position: Floats) -> float:
        """W of the drives that hold the arm at a position [axes] with open brakes."""
        still = np.zeros((1, len(position)))
        return float(self.grey.drive_power(self.grey.rigid_torque(position[None], still, still), still, still)[0])

    @property
    def knows_brakes(self) -> bool:
        """Whether the model has learned what closed brakes save."""
        return "brake" in self.grey.signals

    def __contains__(self, effect: str) -> bool:
        """Whether the loop has added an effect of this name."""
        return isinstance(self.model, Augmented) and any(term.id == effect for term in self.model.terms)
