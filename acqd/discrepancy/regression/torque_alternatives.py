"""Unnamed torque laws as hypotheses: one group of columns for every law and joint, and laws of one coefficient."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from acqd.arrays import Floats
from acqd.models.effects.laws import TORQUE_LAWS
from acqd.models.effects.laws.friction_laws import KNOTS, CoupledFriction, CurvedFriction
from acqd.models.effects.laws.law import Law, MotionRange
from acqd.models.effects.scene import Scene
from acqd.report.digits import percent

_BEGINNINGS = (1, 2, 3)
"""Knots above which a friction of one coefficient may begin."""


@dataclass(frozen=True, slots=True)
class LawColumns:
    """Some columns of an unnamed law at a joint."""

    law: Law
    joint: int
    """From 1; 0 for the whole robot."""
    columns: tuple[int, ...]
    """Indices into the columns of `law.at`."""

    @classmethod
    def whole(cls, law: Law, joint: int, axes: int) -> LawColumns:
        """All columns."""
        return cls(law, joint, tuple(range(law.count(axes))))


def torque_columns(scene: Scene, motion: MotionRange) -> list[Floats]:
    """Columns [N] W at substeps in the order of `torque_groups`; `motion`: range of all recordings."""
    groups = torque_groups(scene.axes)
    return [column for group in groups for column in group.law.at(scene, group.law.shape_of(motion, group.joint)).T]


def torque_groups(axes: int) -> list[LawColumns]:
    """Every law at every joint."""
    return [LawColumns.whole(law, joint, axes) for law in TORQUE_LAWS for joint in law.joints(axes)]


def single_laws(axes: int) -> Iterator[tuple[str, LawColumns]]:
    """Names and columns of laws of one coefficient: single columns of the groups.

    A friction of a joint that grows with the speed of one other joint, or that begins above a speed. Beside them, a
    group with a coefficient for every other joint or every piece of the curve pays for what it does not need.
    """
    coupled, curved = CoupledFriction(), CurvedFriction()
    for joint in range(1, axes + 1):
        others = [other for other in range(1, axes + 1) if other != joint]
        for number, other in enumerate(others):
            name = f"a friction of joint {joint} that grows with the speed of joint {other}"
            yield name, LawColumns(coupled, joint, (number,))
        for knot in _BEGINNINGS:
            name = f"a friction of joint {joint} that begins above {percent(KNOTS[knot])} of its highest speed"
            yield name, LawColumns(curved, joint, (1 + knot,))
