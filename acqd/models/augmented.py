"""A model with added physical effects; every effect can be addressed and removed."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects import holdable
from acqd.models.effects.effect import effect_rows_at, torque_rows_by_joint
from acqd.models.effects.places import Place
from acqd.models.effects.scene import Scene, make_scene
from acqd.models.effects.substeps import RADIUS
from acqd.models.features import padded
from acqd.models.greybox.model import GreyBox
from acqd.models.predictor import Beyond, Predictor

ORIGIN = "origin_s"
"""Keys of a shape that begin so hold UTC of the start of a session."""
_JOINT = re.compile(r"joint (\d+)")
"""Place of an effect at one joint."""


@dataclass(frozen=True, slots=True)
class Term:
    """An effect, or a law without a name, with its parameters."""

    id: str
    where: str
    shape: dict[str, float]
    columns: tuple[int, ...]
    """Indices into the columns of `Effect.at`."""
    coefficients: Floats
    """[columns] weights of the columns."""
    parameters: dict[str, Any]
    """Parameters with units and intervals, for reports."""

    @classmethod
    def of(
        cls, identity: str, place: Place, shape: dict[str, float], values: Floats, parameters: dict[str, Any]
    ) -> Term:
        """From fitted values, and the parameters as reports show them."""
        weights = values if place.mix is None else place.mix @ values
        return cls(identity, place.where, shape, place.columns, np.asarray(weights), parameters)

    def rows(self, scene: Scene) -> Floats:
        """[T] W of the effect."""
        effect = holdable()[self.id]
        return effect_rows_at(effect, scene, self.shape, self.columns, self.coefficients) @ self.coefficients

    def session_start(self, at_s: float) -> float | None:
        """UTC of the start of the session that a time belongs to, s; None where no session is known."""
        starts = sorted(value for key, value in self.shape.items() if key.startswith(ORIGIN))
        return max((start for start in starts if start <= at_s), default=starts[0] if starts else None)

    def by_joint(self, scene: Scene) -> Floats:
        """[T, axes + 1] W of the effect at every joint, and in the last column what is of no joint."""
        effect = holdable()[self.id]
        power = np.zeros((scene.rows, scene.axes + 1))
        if effect.acts_on == "torque":
            power[:, :-1] = torque_rows_by_joint(effect, scene, self.shape, self.columns, self.coefficients)
            return power
        joint = _JOINT.fullmatch(self.where)
        power[:, int(joint[1]) - 1 if joint else -1] = self.rows(scene)
        return power

    def as_json(self) -> dict[str, Any]:
        """For bundle.json."""
        return {
            "id": self.id,
            "where": self.where,
            "shape": dict(self.shape),
            "columns": list(self.columns),
            "coefficients": self.coefficients.tolist(),
            "parameters": self.parameters,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Term:
        """From bundle.json. Raises ValueError for an unknown effect."""
        if data["id"] not in holdable():
            raise ValueError(f"effect {data['id']!r} is unknown to this version of acqd")
        return cls(
            data["id"], data["where"], data["shape"], tuple(data["columns"]), np.array(data["coefficients"]),
            data["parameters"],
        )  # fmt: skip


@dataclass(slots=True)
class _State:
    """State of a row-by-row prediction."""

    base: Any
    recent: deque[tuple[Floats, Floats]]
    """Angles and signals of the last rows, for effects that depend on the past."""
    memory: dict[str, Any]
    """What effects remember from before the recent rows."""
    scene: Scene | None = None
    """What the effects of the last row were computed from."""


_PAST = 75
"""Rows (3 s) of the past that a row-by-row prediction uses for effects: longer than any event or lag."""
_USUAL_V = 230.0


class Augmented(Predictor):
    """A base model plus terms; `carrier` is the grey box whose torques the effects use, often the base itself."""

    def __init__(self, base: Predictor, carrier: GreyBox, terms: list[Term]) -> None:
        self.base, self.carrier, self.terms = base, carrier, terms
        self.axes, self.step_s = base.axes, base.step_s
        self.radius = max(base.radius, RADIUS)
        needed = set(carrier.signals) if terms else set()
        for term in terms:
            needed |= holdable()[term.id].signals_of(term.columns)
        self.signals = (*base.signals, *sorted(needed - set(base.signals)))

    @classmethod
    def of(cls, base: Predictor, carrier: GreyBox, terms: list[Term]) -> Predictor:
        """`base` with more terms, in addition to its own."""
        if isinstance(base, Augmented):
            return cls(base.base, base.carrier, [*base.terms, *terms])
        return cls(base, carrier, terms) if terms else base

    def without(self, identity: str) -> Augmented:
        """The model without one effect."""
        return Augmented(self.base, self.carrier, [term for term in self.terms if term.id != identity])

    def usual_signals(self) -> Floats:
        """[signals] usual values, for signals that are not logged; the nominal voltage for Vrms."""
        usual = dict(zip(self.carrier.signals, self.carrier.usual_signals(), strict=True))
        usual |= dict(zip(self.base.signals, self.base.usual_signals(), strict=True))
        nominal = [term.shape["nominal_V"] for term in self.terms if "nominal_V" in term.shape]
        usual.setdefault("Vrms", nominal[0] if nominal else _USUAL_V)
        return np.array([usual.get(name, 0.0) for name in self.signals])

    def sequence(
        self, q: Floats, signals: Floats | None = None, start_s: float | None = None, beyond: Beyond = padded
    ) -> Floats:
        """[T] W of a recording; effects that follow the clock need `start_s` (Unix s) and are 0 without."""
        known = self.known(signals, len(q))
        return self._base_rows(beyond(q, self.base.radius), known) + self.effects(beyond(q, RADIUS), known, start_s)

    def run(self, q: Floats, signals: Floats) -> Floats:
        """[T] W for angles [T + 2 radius, axes] and signals [T, k]."""
        inner, outer = self.radius - self.base.radius, self.radius - RADIUS
        base = self._base_rows(q[inner : len(q) - inner], signals)
        return base + self.effects(q[outer : len(q) - outer], signals, None)

    def effects(self, q: Floats, signals: Floats, start_s: float | None) -> Floats:
        """[T] W of all effects for angles [T + 2 RADIUS, axes]."""
        if not self.terms:
            return np.zeros(len(signals))
        return self._powers(self._scene(q, signals, start_s), start_s)

    def effects_by_joint(self, q: Floats, signals: Floats, start_s: float | None) -> list[Floats]:
        """[T, axes + 1] W of every term, for angles [T + 2 RADIUS, axes]; in the last column what is of no joint."""
        scene = self._scene(q, signals, start_s)
        return [self._since(term, term.by_joint(scene), start_s) for term in self._in_session(scene, start_s)]

    def latest_by_joint(self, state: Any) -> list[Floats]:
        """[axes + 1] W of every term in the last `step`; in the last column what is of no joint."""
        return [term.by_joint(state.scene)[-1] for term in self._in_session(state.scene, None)]

    def _powers(self, scene: Scene, start_s: float | None) -> Floats:
        terms = self._in_session(scene, start_s)
        return np.sum([self._since(term, term.rows(scene), start_s) for term in terms], axis=0)  # type: ignore[no-any-return]

    def _in_session(self, scene: Scene, start_s: float | None) -> Iterator[Term]:
        """Every term, while the scene's memory has the start of the term's session."""
        for term in self.terms:
            origin_s = None if start_s is None else term.session_start(start_s)
            if origin_s is not None:
                scene.memory["origin_s"] = origin_s
            yield term

    def _since(self, term: Term, power: Floats, start_s: float | None) -> Floats:
        """`power` [T] or [T, k] W; 0 before an effect with a later start."""
        if start_s is None or "begin_s" not in term.shape:
            return power
        t = start_s + self.step_s * np.arange(len(power))
        return (power.T * (t >= term.shape["begin_s"])).T

    def _scene(self, q: Floats, signals: Floats, start_s: float | None) -> Scene:
        named = dict(zip(self.signals, signals.T, strict=True))
        volts = named.pop("Vrms", None)
        return make_scene(self.carrier, q, named, start_s or 0.0, volts)

    def _base_rows(self, q: Floats, signals: Floats) -> Floats:
        return self.base.run(q, signals[:, : len(self.base.signals)])

    def start(self) -> Any:
        """Initial state of a row-by-row prediction."""
        return _State(self.base.start(), deque(maxlen=_PAST), {})

    def step(self, state: Any, window: Floats, signals: Floats) -> float:
        """W of one row; effects are computed from the last three seconds and what they remember from before."""
        inner, middle = self.radius - self.base.radius, self.radius
        base = self.base.step(state.base, window[inner : len(window) - inner], signals[: len(self.base.signals)])
        if not self.terms:
            return base
        state.recent.append((window[middle], signals))
        before = np.array([row for row, _ in state.recent])
        past = np.repeat(before[:1], RADIUS, axis=0) if len(before) < _PAST else before[:RADIUS]
        own = before if len(before) < _PAST else before[RADIUS:]
        recent_signals = np.array([row for _, row in state.recent])[len(before) - len(own) :]
        angles = np.concatenate([past, own, window[middle + 1 : middle + 1 + RADIUS]])
        scene = self._scene(angles, recent_signals, None)
        scene.memory.update(state.memory)
        state.scene = scene
        power = float(self._powers(scene, None)[-1])
        if passed := _passed(len(before)):
            for term in self.terms:
                state.memory |= holdable()[term.id].remembered(scene, term.shape, passed)
        return base + power


def _passed(rows: int) -> int:
    """Number of rows that the next scene no longer has, after a scene of the last `rows`."""
    if rows == _PAST:
        return 1
    return RADIUS if rows == _PAST - 1 else 0  # then the first rows become the past of the others
