"""The grey box, the hybrid and the networks as a regressor of scikit-learn. Needs the extra `sklearn`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np

from acqd.errors import UserError
from acqd.extras import install_command

try:
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.metrics import r2_score
    from sklearn.utils.validation import check_consistent_length, check_is_fitted, validate_data
except ModuleNotFoundError:
    raise UserError(f"PowerRegressor needs scikit-learn: {install_command('sklearn')}") from None

from acqd.api.doubts import doubtful_power, scaled, warn_of, written_twice
from acqd.api.places import Place
from acqd.api.robot import Robot
from acqd.dataset.column_check import judge_recordings
from acqd.dataset.config import LONGEST_STEP_S
from acqd.dataset.cut import CONTEXT_ROWS
from acqd.dataset.merge import Recording
from acqd.dataset.split import Part
from acqd.dataset.table_motion import trusted_motion
from acqd.dataset.unaligned import clock_doubts, pair_of
from acqd.models.config import TrainConfig
from acqd.models.networks.settings import TrainingSettings
from acqd.models.segments import Dataset, Segment, neighbours
from acqd.models.training import NAMES, fit
from acqd.numerics import runs_of_true
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log_ends import unknown_ends

if TYPE_CHECKING:
    import pandas
    from numpy.typing import ArrayLike, NDArray
    from sklearn.utils import Tags

    from acqd.arrays import Floats

    Table: TypeAlias = ArrayLike | pandas.DataFrame | pandas.Series

_VALIDATION = 0.15  # of the rows, where all are one recording
_MIN_ROWS = 4  # of a recording: two parts, and a difference in each


class PowerRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Mains power [W] of a robot from its joint angles [rad], row by row in time.

    X [T, axes + signals] are angles, then the logged signals named in `signals`; rows are `step_s` apart. `groups`
    tells recordings apart, because velocities and the state of a network do not cross from one to the next; without
    it, all rows are one recording. Rows must stay in the order of time: cross-validation has to keep whole recordings
    (`GroupKFold`), and X may not be shuffled. With scikit-learn's metadata routing enabled, `params={"groups": names}`
    of `cross_val_score` reaches the folds, fit and score; without it, scikit-learn keeps the names from the estimator.

    >>> frame = Dataset("ds").to_pandas().query("valid")
    >>> X, y = frame[[f"q{k}" for k in range(1, 7)]], frame["P"]
    >>> model = PowerRegressor("grey-box", robot="ur10e").fit(X, y, groups=frame["recording"])
    >>> model.score(X, y, groups=frame["recording"]) > 0.9
    True
    """

    __metadata_request__fit: ClassVar = {"groups": True}  # scikit-learn's name for the default of set_fit_request
    __metadata_request__predict: ClassVar = {"groups": True}
    __metadata_request__score: ClassVar = {"groups": True}

    def __init__(
        self,
        network: str = "grey-box",
        *,
        robot: Robot | Place | None = None,
        step_s: float = 0.04,
        signals: Sequence[str] = (),
        epochs: int = 300,
        seed: int = 1,
    ) -> None:
        """`network` as in `acqd.train`; grey-box and hybrid need `robot`, networks use `epochs`."""
        self.network = network
        self.robot = robot
        self.step_s = step_s
        self.signals = signals
        self.epochs = epochs
        self.seed = seed

    def fit(self, X: Table, y: Table, groups: Table | None = None) -> PowerRegressor:
        """Fit to angles X [T, axes + signals] and power y [T]. Raises ValueError, UserError."""
        X, y = validate_data(self, X, y, dtype=np.float64, ensure_min_samples=_MIN_ROWS, y_numeric=True)
        if self.network not in NAMES:
            raise ValueError(f"no network {self.network!r}; the networks are {', '.join(NAMES)}")
        _require_step(self.step_s)
        axes = X.shape[1] - len(self.signals)
        robot = self._robot_of(axes)
        y = np.asarray(y, dtype=np.float64)
        changed = list(scaled(X[:, :axes])) if robot else []
        warn_of(changed)
        recordings = [self._recording(robot, k, X, y, rows, axes) for k, rows in enumerate(_recordings(groups, len(X)))]
        if robot:
            description = load_description(robot)
            warn_of([*doubtful_power(y, description), *written_twice(X, y, recordings)])
            warn_of([] if changed else self._doubts(recordings, description))
        segments = _with_validation([segment for each in recordings for segment in self._segments(each, axes)])
        if not segments:
            raise UserError(f"no recording has {_MIN_ROWS} consecutive rows whose motion is known")
        data = Dataset(Path("memory"), "0" * 64, robot, robot, self.step_s, "mains", segments)
        settings = TrainingSettings(epochs=self.epochs)
        with tempfile.TemporaryDirectory() as folder:  # of the network's checkpoint
            out = Path(folder) / "bundle"
            config = TrainConfig(Path("memory"), self.network, out, (), self.seed, settings)
            self.predictor_ = fit(config, data, lambda *_: None).predictor
        return self

    def predict(self, X: Table, groups: Table | None = None) -> Floats:
        """Power [T] W of angles and signals X [T, axes + signals]."""
        check_is_fitted(self, "predictor_")
        X = validate_data(self, X, dtype=np.float64, reset=False)
        model = self.predictor_
        robot = self._robot_of(model.axes)
        signals = X[:, model.axes :][:, [list(self.signals).index(name) for name in model.signals]]
        power = np.empty(len(X))
        for rows in _recordings(groups, len(X)):
            q, _ = self._motion(robot, X[:, : model.axes], rows)
            power[rows] = model.recording(q, signals[rows])
        return power

    def score(self, X: Table, y: Table, sample_weight: ArrayLike | None = None, groups: Table | None = None) -> float:
        """Coefficient of determination R^2 of the prediction, of rows whose acceleration is known.

        Where a recording begins or ends in motion, the first or last row does not count.
        """
        power = self.predict(X, groups)
        if robot := self._robot_of(self.predictor_.axes):
            warn_of(doubtful_power(np.asarray(y, dtype=np.float64).ravel(), load_description(robot)))
        q = np.asarray(X, dtype=np.float64)[:, : self.predictor_.axes]
        weight = np.ones(len(q)) if sample_weight is None else np.array(sample_weight, dtype=np.float64)
        for rows in _recordings(groups, len(q)):
            weight[rows][unknown_ends(q[rows], np.ones(len(q[rows]), bool), self.step_s)] = 0.0
        return float(r2_score(y, power, sample_weight=weight))

    def _robot_of(self, axes: int) -> str:
        """The description of a robot with so many joints; empty for networks. Raises ValueError, UserError."""
        if self.network not in ("grey-box", "hybrid"):
            return ""
        if self.robot is None:
            raise ValueError(f"network {self.network!r} needs a robot description: PowerRegressor(robot=...)")
        robot = self.robot.source if isinstance(self.robot, Robot) else str(self.robot)
        expected = load_description(robot).axes
        if axes != expected:
            named = f", then the signals {', '.join(self.signals)}" if len(self.signals) else ""
            raise ValueError(f"X has {axes} joint angles{named}, but {robot} has {expected} joints")
        return robot

    def _doubts(self, recordings: list[Recording], robot: RobotDescription) -> list[str]:
        """Lines on power of another time or order of the axes. Raises UserError where the order is another one."""
        pairs = [pair_of(each, robot, self.step_s) for each in recordings]
        late = clock_doubts(pairs, robot, lambda _: "shift y by that")
        return late or judge_recordings(recordings, robot, None)

    def _motion(self, robot: str, X: Floats, rows: slice) -> tuple[Floats, NDArray[np.bool_]]:
        """Angles [T, axes] of a recording, and which of its rows [T] are known.

        Raises ValueError where they are no motion of the robot: shuffled, mixed, or in degrees.
        """
        q = X[rows]
        if not robot:
            return q, np.ones(len(q), bool)
        try:
            q, known, _ = trusted_motion(np.asarray(self.step_s * np.arange(len(q))), q, load_description(robot))
        except ValueError as error:
            first = "" if len(q) == len(X) else f"rows from {rows.start} on: "
            raise ValueError(
                f"{first}{error} Rows must be in the order of time; groups= names the recording of each (in "
                "cross_val_score: sklearn.set_config(enable_metadata_routing=True) and params={'groups': names})"
            ) from None
        return q, known

    def _recording(self, robot: str, number: int, X: Floats, y: Floats, rows: slice, axes: int) -> Recording:
        q, known = self._motion(robot, X[:, :axes], rows)
        valid = known & ~unknown_ends(q, known, self.step_s)
        columns = {f"q{axis + 1}": angles for axis, angles in enumerate(q.T)} | {"P": y[rows]}
        columns |= {name: X[rows, axes + k] for k, name in enumerate(self.signals)}
        time_ns = np.rint(1e9 * self.step_s * np.arange(len(q))).astype(np.int64)
        return Recording(f"r{number:04d}", time_ns, columns, valid, known & ~valid)

    def _segments(self, recording: Recording, axes: int) -> Iterator[Segment]:
        q, P, name = recording.of_axes("q", axes), recording.columns["P"], recording.name
        context = np.zeros(len(P), bool) if recording.context is None else recording.context
        for first, last in runs_of_true(recording.valid):
            if last - first < min(_MIN_ROWS, len(P)):
                continue  # between rows that are not known
            before, after = neighbours(q, context, first, last)
            rows = slice(first, last)
            signals = {signal: recording.columns[signal][rows] for signal in self.signals}
            yield Segment(name, name, "other", "train", q[rows], P[rows], None, signals, before=before, after=after)

    def __sklearn_tags__(self) -> Tags:
        """Rows are a sequence: scores on the shuffled toy data of scikit-learn's checks are poor."""
        tags = super().__sklearn_tags__()
        tags.regressor_tags.poor_score = True
        tags.non_deterministic = False
        return tags


def _require_step(step_s: object) -> None:
    """Raises ValueError for a step that is no time between rows."""
    if not isinstance(step_s, (int, float, np.number)) or not 0.0 < float(step_s) <= LONGEST_STEP_S:
        raise ValueError(
            f"step_s={step_s!r}: expected the seconds between rows, up to {LONGEST_STEP_S:g}: 0.04 is 40 ms"
        )


def _named(group: object) -> bool:
    """Whether a group is a name: not None, NaN, NaT or NA, which differ from themselves, or do not know."""
    try:
        return group is not None and bool(group == group)
    except TypeError:
        return False


def _recordings(groups: Table | None, rows: int) -> list[slice]:
    """Slices of consecutive rows with the same group. Raises ValueError for another length."""
    if groups is None:
        return [slice(0, rows)]
    names = np.asarray(groups)
    if names.ndim != 1 and names.size != len(names):
        raise ValueError(f"groups has {names[0].size} values in a row: expected one, the name of its recording")
    names = names.ravel()
    check_consistent_length(names, np.empty(rows))
    nameless = np.array([not _named(name) for name in names], bool) if names.dtype == object else names != names
    if nameless.any():
        raise ValueError(f"row {int(nameless.argmax()) + 1} has no group: name the recording of every row")
    changes = np.flatnonzero(names[1:] != names[:-1]) + 1
    seen = names[np.concatenate([[0], changes])] if rows else names
    kinds, counts = np.unique(seen, return_counts=True)
    if len(kinds) < len(seen):
        raise ValueError(
            f"rows of the group {kinds[counts.argmax()]!r} are not consecutive: sort the rows by recording, then time"
        )
    edges = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist(), rows]
    return [slice(first, last) for first, last in pairwise(edges)]


def _with_validation(segments: list[Segment]) -> list[Segment]:
    """Every seventh recording for validation; of fewer than seven the end of each."""
    if len(segments) >= 7:
        return [replace(s, split=_part(k)) for k, s in enumerate(segments)]
    parts = []
    for segment in segments:
        end = min(len(segment.P) - 2, max(2, int((1 - _VALIDATION) * len(segment.P))))
        if end < 2:
            raise UserError(f"a recording of {len(segment.P)} rows is too short: expected at least {_MIN_ROWS}")
        q = segment.q
        halves: list[tuple[slice, Part]] = [(slice(None, end), "train"), (slice(end, None), "validation")]
        for rows, part in halves:
            signals = {name: values[rows] for name, values in segment.signals.items()}
            half = replace(segment, split=part, q=q[rows], P=segment.P[rows], signals=signals)
            if part == "train":
                parts.append(replace(half, after=q[end:][:CONTEXT_ROWS]))
            else:
                parts.append(replace(half, before=q[:end][-CONTEXT_ROWS:]))
    return parts


def _part(number: int) -> Part:
    return "validation" if number % 7 == 3 else "train"
