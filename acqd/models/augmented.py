"""A model with physical effects added: each of them addressable, and as easily taken away again."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows_at
from acqd.models.effects.places import Place
from acqd.models.effects.scene import Scene, make_scene
from acqd.models.effects.substeps import RADIUS
from acqd.models.features import padded
from acqd.models.greybox.model import GreyBox
from acqd.models.predictor import Predictor


@dataclass(frozen=True, slots=True)
class Term:
    """One effect with its parameters."""

    id: str
    where: str
    shape: dict[str, float]
    columns: tuple[int, ...]
    """Of what `Effect.at` gives."""
    coefficients: Floats
    """W per unit of each of those columns, times its parameter."""
    parameters: dict[str, Any]
    """Parameters with units and intervals, as the closing report has them."""

    @classmethod
    def of(
        cls, identity: str, place: Place, shape: dict[str, float], values: Floats, parameters: dict[str, Any]
    ) -> Term:
        """From fitted values and what the closing report says of each parameter."""
        weights = values if place.mix is None else place.mix @ values
        return cls(identity, place.where, shape, place.columns, np.asarray(weights), parameters)

    def rows(self, scene: Scene) -> Floats:
        """[T] W."""
        effect = library()[self.id]
        return effect_rows_at(effect, scene, self.shape, self.columns, self.coefficients) @ self.coefficients

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
        """Back from bundle.json."""
        if data["id"] not in library():
            raise ValueError(f"effect {data['id']!r} is unknown to this version of acqd")
        return cls(
            data["id"], data["where"], data["shape"], tuple(data["columns"]), np.array(data["coefficients"]),
            data["parameters"],
        )  # fmt: skip


@dataclass(slots=True)
class _State:
    """Of a row-by-row prediction."""

    base: Any
    recent: deque[tuple[Floats, Floats]]
    """Angles and signals of the last rows: what effects need of the past."""


_PAST = 75
"""Rows (3 s) of the past that a row-by-row prediction uses for effects: longer than any event or lag."""
_USUAL_V = 230.0


class Augmented(Predictor):
    """See the module. `carrier` is the grey box whose torques the effects act on; often it is the base itself."""

    def __init__(self, base: Predictor, carrier: GreyBox, terms: list[Term]) -> None:
        self.base, self.carrier, self.terms = base, carrier, terms
        self.axes, self.step_s = base.axes, base.step_s
        self.radius = max(base.radius, RADIUS)
        needed = set(carrier.signals) if terms else set()
        for term in terms:
            needed |= library()[term.id].signals_of(term.columns)
        self.signals = (*base.signals, *sorted(needed - set(base.signals)))

    @classmethod
    def of(cls, base: Predictor, carrier: GreyBox, terms: list[Term]) -> Predictor:
        """`base` with more terms, beside those that it may have already."""
        if isinstance(base, Augmented):
            return cls(base.base, base.carrier, [*base.terms, *terms])
        return cls(base, carrier, terms) if terms else base

    def without(self, identity: str) -> Augmented:
        """The same with one effect taken away."""
        return Augmented(self.base, self.carrier, [term for term in self.terms if term.id != identity])

    def usual_signals(self) -> Floats:
        """See Predictor."""
        usual = dict(zip(self.carrier.signals, self.carrier.usual_signals(), strict=True))
        usual |= dict(zip(self.base.signals, self.base.usual_signals(), strict=True))
        nominal = [term.shape["nominal_V"] for term in self.terms if "nominal_V" in term.shape]
        usual.setdefault("Vrms", nominal[0] if nominal else _USUAL_V)
        return np.array([usual.get(name, 0.0) for name in self.signals])

    def sequence(self, q: Floats, signals: Floats | None = None, start_s: float | None = None) -> Floats:
        """See Predictor; effects that follow the clock need `start_s` (Unix s), without it they are at rest."""
        known = self.known(signals, len(q))
        return self._base_rows(padded(q, self.base.radius), known) + self.effects(padded(q, RADIUS), known, start_s)

    def run(self, q: Floats, signals: Floats) -> Floats:
        """See Predictor."""
        inner, outer = self.radius - self.base.radius, self.radius - RADIUS
        base = self._base_rows(q[inner : len(q) - inner], signals)
        return base + self.effects(q[outer : len(q) - outer], signals, None)

    def effects(self, q: Floats, signals: Floats, start_s: float | None) -> Floats:
        """[T] W of all effects for angles [T + 2 RADIUS, axes]."""
        if not self.terms:
            return np.zeros(len(signals))
        scene = self._scene(q, signals, start_s)
        powers = []
        for term in self.terms:
            if start_s is not None and "origin_s" in term.shape:  # every term has a clock of its own
                scene.memory["origin_s"] = term.shape["origin_s"]
            powers.append(term.rows(scene))
        if start_s is not None:  # an effect that began later was not there before
            t = start_s + self.step_s * np.arange(scene.rows)
            powers = [
                np.where(t >= term.shape.get("begin_s", -np.inf), power, 0.0)
                for term, power in zip(self.terms, powers, strict=True)
            ]
        return np.sum(powers, axis=0)  # type: ignore[no-any-return]

    def _scene(self, q: Floats, signals: Floats, start_s: float | None) -> Scene:
        named = dict(zip(self.signals, signals.T, strict=True))
        volts = named.pop("Vrms", None)
        return make_scene(self.carrier, q, named, start_s or 0.0, volts)

    def _base_rows(self, q: Floats, signals: Floats) -> Floats:
        return self.base.run(q, signals[:, : len(self.base.signals)])

    def start(self) -> Any:
        """See Predictor."""
        return _State(self.base.start(), deque(maxlen=_PAST))

    def step(self, state: Any, window: Floats, signals: Floats) -> float:
        """See Predictor; effects are computed from the last three seconds."""
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
        return base + float(self.effects(angles, recent_signals, None)[-1])
