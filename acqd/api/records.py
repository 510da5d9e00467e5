"""What report.json and bundle.json hold, as types. Both may have further keys; keys are added, none is renamed."""

from __future__ import annotations

from typing import Literal, NotRequired, TypedDict

Verdict = Literal["effects_found", "nothing_left", "unknown_structure", "not_identifiable"]


class Errors(TypedDict):
    """Errors of a prediction on recordings that took no part in its fit."""

    mae: float
    """Mean absolute error, W."""
    rmse: float
    """Root mean square error, W."""
    bias: float
    """Mean error, W."""
    whiteness: NotRequired[float | None]
    """Of the residual."""


class Parameter(TypedDict):
    """A parameter of an effect."""

    value: float
    unit: str
    ci95: list[float] | None
    """Ends of the 95 % interval; None where the recordings are too few for one."""


class Rival(TypedDict):
    """What else could explain the same."""

    id: str | None
    """None: a law without a name."""
    name: str
    confidence: float


class Effect(TypedDict):
    """An effect that was named."""

    id: str
    where: str
    parameters: dict[str, Parameter]
    delta_rmse: float
    """W by which the error shrinks."""
    share_of_explainable: float
    confidence: float
    rivals: list[Rival]
    evidence: str
    added: bool
    """Whether the repaired model has the effect."""


class Recordings(TypedDict):
    """How many recordings were used."""

    fit: int
    held_out: int


class Report(TypedDict):
    """report.json."""

    target: str
    unit: str
    measured: str
    recordings: Recordings
    noise_floor: float
    """W RMS that no model of motion can predict."""
    before: Errors
    after: Errors
    verdict: Verdict
    effects: list[Effect]
    unexplained: str
    next: list[str]
    """What to do, most useful first."""
    joint_names: NotRequired[list[str]]
    """The robot's names of joint 1, joint 2 ...; reports of earlier versions have none."""
    notes: list[str]
    warnings: list[str]
    """The notes that the verdict has to be read with."""


class Metrics(TypedDict):
    """Errors by split of the data; None where a split has no recordings."""

    train: Errors | None
    validation: Errors | None
    test: Errors | None


class Metadata(TypedDict):
    """bundle.json."""

    kind: str
    """grey_box, hybrid or network."""
    name: str
    robot: str
    axes: int
    step_s: float
    """Time between rows, s."""
    target: str
    unit: str
    measured: str
    metrics: Metrics
