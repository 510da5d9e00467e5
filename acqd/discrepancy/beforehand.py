"""Before recording: what the motion of a dataset can tell, with the model and the noise of the reference.

The power of the recordings to come is unknown. The model predicts it, and the residual that the model has on its
reference lies on it, so that columns, noise and differences between sessions are those of the loop (ADR 48).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.ability.ability import Ability
from acqd.discrepancy.ability.choices import Choice, assumptions, choices_table, most_helpful
from acqd.discrepancy.further_columns import further_choices, unread
from acqd.discrepancy.recordings import carrier_in
from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.discrepancy.selection.session_columns import with_sessions
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import UserError
from acqd.models.bundle.reference import load_reference
from acqd.models.bundle.restore import open_model
from acqd.models.effects import library
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment, load_dataset
from acqd.motion.controller import RATE, Controller, Motion
from acqd.motion.program_file import read_program
from acqd.motion.replayed_log import motion_of
from acqd.residual.residuals import errors_of, without_known_effects
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log_reader import read_log

PLANNED = "planned "
"""Names of recordings that are not made yet begin so."""
_LATER_S = 86_400.0
"""The next session is on another day."""
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Beforehand:
    """What recordings of a motion can tell."""

    ability: Ability
    robot: str
    joints: list[str]
    """Names."""
    simulated: bool
    """Whether the power of the reference is simulated."""
    motion: str
    minutes: float
    choices: tuple[Choice, ...]
    """The plan, twice its minutes, and every column that the recordings lack."""

    @property
    def says(self) -> list[str]:
        """What would help most, and what is assumed, in sentences."""
        useless = [f"No effect reads a logged {name}." for name in unread()]
        return [*most_helpful(self.choices), *useless, *assumptions(self.choices)]

    @property
    def choices_table(self) -> list[list[str]]:
        """A header, and a row per choice."""
        return choices_table(self.choices)

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        choices = [each.as_json() for each in self.choices]
        return {
            "motion": self.motion, "minutes": self.minutes, **self.ability.as_json(), "choices": choices,
            "says": self.says,
        }  # fmt: skip


def beforehand(bundle: Path, motion: Path | None, minutes: float | None, progress: Progress) -> Beforehand:
    """Of the motion of a dataset, of a log or program, or of that which the bundle remembers.

    Raises UserError, InputError.
    """
    opened, model = open_model(bundle)
    reference = load_reference(bundle)
    if not reference:
        raise UserError(f"{bundle}: the model remembers no recordings, so that their noise is unknown; train it again")
    if motion is not None and not motion.exists():
        raise UserError(f"{motion}: no such file or folder; name a dataset, a robot's log or a laboratory program")
    carrier = carrier_in(opened, model)
    if carrier is None:
        raise UserError(f"{bundle}: the model has no grey box for the torques of effects; train --network grey-box")
    robot = load_description(opened.metadata["description"])
    if motion is None:
        segments = reference
    elif motion.is_file():
        segments = [like_reference(reference, motion.stem, _motion_in(motion, robot), model.step_s)]
    else:
        segments = _same_robot(motion, model, opened.metadata["robot"])
    planned = without_known_effects(model, with_planned_power(model, reference, segments))
    comparison = Comparison(
        model=carrier, robot=robot, in_question=planned, reference=without_known_effects(model, reference),
        chosen=frozenset(library()), withheld=frozenset(opened.metadata.get("withheld", ())),
    )  # fmt: skip
    setup = set_up(comparison, lambda share: progress("computing the columns of all effects", share))
    recorded = sum(len(segment.P) for segment in segments) * model.step_s / 60
    asked = recorded if minutes is None else minutes
    searched = 1 - 1 / THRESHOLDS.held_out_every  # the loop holds the other recordings out
    rows, longer = with_sessions(setup), searched * asked / recorded
    ability = Ability.planned(rows, rows.design.columns.in_question, longer)
    choices = further_choices(comparison, rows, ability, longer, progress)
    named = str(bundle if motion is None else motion)
    simulated = opened.metadata.get("measured") == "simulated"
    return Beforehand(ability, robot.title, robot.joint_names, simulated, named, asked, choices)


def _same_robot(motion: Path, model: Predictor, name: str) -> list[Segment]:
    """The recordings of a dataset of the model's robot. Raises UserError, InputError."""
    data = load_dataset(motion)
    if data.robot != name or abs(data.step_s - model.step_s) > 1e-9:
        raise UserError(
            f"{motion} is of {data.robot} with rows of {data.step_s} s, the model of {name} with rows of "
            f"{model.step_s} s: name a dataset of this robot, built with the model's step"
        )
    return data.segments


def _motion_in(path: Path, robot: RobotDescription) -> Motion:
    """Of a robot's log, or of a laboratory program. Raises UserError, InputError."""
    if path.suffix != ".toml":
        return motion_of(read_log(path, robot), robot)
    program = read_program(path, robot)
    return Controller(robot, program.start).run(list(program.steps))


def like_reference(reference: list[Segment], name: str, motion: Motion, step_s: float) -> Segment:
    """A recording of a motion with the signals of the reference, without power.

    Voltages and temperatures are those that are usual in the reference.
    """
    rows = np.arange(round(len(motion) / RATE / step_s) - 1)
    at = np.minimum((rows * step_s * RATE).astype(int), len(motion) - 1)
    known = {"brake": motion.brake_open[at] * 1.0, "tool": motion.tool_on[at] * 1.0}
    return replace(
        reference[0], recording=name, source=name, q=motion.q[at], P=np.zeros(len(at)), tau=None,
        signals={name: known[name] for name in reference[0].signals if name in known},
        channels=_usual_channels(reference, len(at)), before=None, after=None, content=name, labels={},
    )  # fmt: skip


def _usual_channels(reference: list[Segment], rows: int) -> dict[str, Floats]:
    """Medians of the voltages and temperatures of the reference; currents of motors belong to another motion."""
    channels = {}
    for name, values in reference[0].channels.items():
        if name == "current" or not all(name in segment.channels for segment in reference):
            continue
        usual = np.nanmedian(np.concatenate([segment.channels[name] for segment in reference]), axis=0)
        channels[name] = np.tile(usual, (rows, *[1] * (values.ndim - 1)))
    return channels


def with_planned_power(model: Predictor, reference: list[Segment], motion: list[Segment]) -> list[Segment]:
    """Recordings of a motion on another day: predicted power with the reference's residual, in its order."""
    noise = np.concatenate(errors_of(model, reference))
    later = max(segment.start_s for segment in reference) - min(segment.start_s for segment in motion) + _LATER_S
    planned, begin = [], 0
    for segment, predicted in zip(motion, predictions(model, motion), strict=True):
        rows = (begin + np.arange(len(predicted))) % len(noise)
        begin += len(predicted)
        name = f"{PLANNED}{segment.recording}"
        planned.append(replace(segment, recording=name, P=predicted + noise[rows], start_s=segment.start_s + later))
    return planned
