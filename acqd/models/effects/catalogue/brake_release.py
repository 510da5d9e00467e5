"""The power peak when the brakes open."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.events import bins, edges, since
from acqd.models.effects.limits import LARGEST_INRUSH_W
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox

_LIMITS_S = (-0.02, 0.02, 0.06, 0.10, 0.16, 0.24, 0.36, 0.6)


class BrakeRelease(Effect):
    """A peak of free shape within 0.6 s after the brakes open."""

    id = "brake_release"
    cause = Cause.BRAKES
    summary = "a peak when the brakes open: pull-in current of the coils and inrush of the motors"
    equation = "P = h(time since the brakes opened), free within 0.6 s"
    neighbours = ("clock_offset", "brake_holding")
    experiment = "release the brakes ten times without moving"
    needs = ("brake",)
    c_body = """
    power = bin_value(p->brake_age, limit, sizeof limit / sizeof *limit - 1, c);
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, intervals] 1 within an interval of the time since the brakes opened."""
        rises, _ = edges(scene.signals["brake"], scene, "brake")
        return bins(since(rises, scene, "brake_age"), _LIMITS_S)

    def places(self, scene: Scene) -> Iterator[Place]:
        """The brakes, with the power in every interval."""
        names = [f"power {max(low, 0) * 1000:.0f}-{high * 1000:.0f} ms" for low, high in pairwise(_LIMITS_S)]
        most_W = LARGEST_INRUSH_W * scene.axes
        powers = tuple(Parameter(name, "W", -most_W, most_W) for name in names)
        yield Place("brakes", tuple(range(len(names))), powers)

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Limits of the intervals, s."""
        return {"limit": np.array(_LIMITS_S)}
