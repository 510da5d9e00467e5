"""The check of a description: its findings, its guesses and their influence, as one result."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from acqd.robot.description import RobotDescription
from acqd.robot.plausibility import Finding, implausible
from acqd.robot_check.sensitivity import Influence, Sensitivity, sensitivity

_MATTERS = 0.1
"""Share of the power's standard deviation, 1: guesses that change the power by less need no look."""


@dataclass(frozen=True, slots=True)
class Check:
    """What there is to say about a description."""

    robot: RobotDescription
    findings: list[Finding]
    power: Sensitivity

    @property
    def wrong(self) -> bool:
        """Whether a finding contradicts physics."""
        return any(finding.state == "wrong" for finding in self.findings)

    @property
    def guesses(self) -> dict[str, list[str]]:
        """Guessed keys, and friction that is not described, by joint."""
        return {
            joint.name: [*joint.guessed, *([] if joint.friction else ["friction (not described)"])]
            for joint in self.robot.joint
        }

    @property
    def guessed_influences(self) -> list[Influence]:
        """Influences of guessed values, largest first."""
        return [each for each in self.power.influences if each.guessed]

    @property
    def guessed_change(self) -> float:
        """RMS change of the power by all guesses together, if they are wrong independently of each other, W."""
        return math.hypot(*(each.change_W for each in self.guessed_influences))

    @property
    def guesses_matter(self) -> bool:
        """Whether the guesses decide a part of the power that is worth a look."""
        return self.guessed_change > _MATTERS * self.power.deviation_W

    @property
    def doubt(self) -> str:
        """What hangs on the guesses, in words; empty if that is little."""
        if not self.guesses_matter:
            return ""
        count = len(self.guessed_influences)
        return (
            f"{count} guessed values change the power by {self.guessed_change:.0f} W RMS together, of "
            f"{self.power.deviation_W:.0f} W: until a model is trained with metered power, a prediction is a guess, too"
        )

    def as_json(self) -> dict[str, Any]:
        """The result as plain data."""
        return {
            "robot": self.robot.name,
            "title": self.robot.title,
            "axes": self.robot.axes,
            "sources": self.robot.sources,
            "guessed": self.guesses,
            "findings": [asdict(finding) for finding in self.findings],
            "power": {key: getattr(self.power, key) for key in ("mean_W", "deviation_W", "peak_W")},
            "guessed_W": self.guessed_change,
            "doubt": self.doubt,
            "influences": [asdict(each) for each in self.power.influences],
        }


def check_description(robot: RobotDescription) -> Check:
    """Check a description; the study of its power takes seconds."""
    return Check(robot, implausible(robot), sensitivity(robot))
