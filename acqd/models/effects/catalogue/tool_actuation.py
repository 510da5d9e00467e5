"""Power of an electric tool."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.events import bins, edges, since
from acqd.models.effects.limits import LARGEST_TOOL_W
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox

_LIMITS_S = (-0.02, 0.1, 0.2, 0.4, 0.7)


class ToolActuation(Effect):
    """Power while the tool is on, and a pulse of free shape whenever the tool switches."""

    id = "tool_actuation"
    cause = Cause.TOOL
    summary = "the tool takes power while it is on, and a pulse whenever it switches"
    equation = "P = P_t tool + h(time since switching)"
    neighbours = ("payload", "process_load")
    experiment = "switch the tool ten times at rest, with nothing in it"
    needs = ("tool",)
    c_body = """
    power = c[0] * p->tool + bin_value(p->tool_age, limit, sizeof limit / sizeof *limit - 1, c + 1);
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1 + intervals]: the tool signal, and 1 within an interval of the time since the tool switched."""
        rises, falls = edges(scene.signals["tool"], scene, "tool")
        age = since(rises + falls, scene, "tool_age")
        return np.column_stack([scene.signals["tool"], bins(age, _LIMITS_S)])

    def places(self, scene: Scene) -> Iterator[Place]:
        """The tool, without and with the pulse."""
        names = [f"pulse {max(low, 0) * 1000:.0f}-{high * 1000:.0f} ms" for low, high in pairwise(_LIMITS_S)]
        power, *pulse = (Parameter(name, "W", -LARGEST_TOOL_W, LARGEST_TOOL_W) for name in ("power", *names))
        yield Place("tool", (0,), (power,))
        yield Place("tool", (0, 1, 2, 3, 4), (power, *pulse))

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Limits of the intervals, s."""
        return {"limit": np.array(_LIMITS_S)}
