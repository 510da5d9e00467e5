"""What logged torques say about a mechanical effect: information about its parameters, the base model marginalised.

Every session has random zeros and random friction (mixed model), whose spread the reference sessions show. What the
model still lacks makes a raw likelihood overconfident: all information is multiplied by a learning rate below 1
(generalised Bayes; Gruenwald 2012), by which reference sessions, left out one at a time, surprise no more than they
should.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.joints.columns import effect_columns
from acqd.discrepancy.joints.observations import Observed
from acqd.discrepancy.joints.sessions import Products, Session, random_deviations
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects import library
from acqd.models.effects.places import Variant
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment
from acqd.numerics import quadratic_form
from acqd.robot.description import RobotDescription

_LEAST_SHARE = 1e-3
"""Of a column's power that the base model must leave, to say anything about it."""
_Key: TypeAlias = tuple[str, tuple[tuple[str, float], ...] | None]
"""Effect and shape; None: all scanned shapes side by side."""


@dataclass(frozen=True, slots=True)
class Information:
    """About the k parameters of an effect, in the scale of the model's torques."""

    precision: Floats
    """[k, k]."""
    product: Floats
    """[k]: precision times the estimate."""

    @property
    def evidence(self) -> float:
        """Twice the log-likelihood ratio of the best parameters against no effect."""
        return float(quadratic_form(self.precision, self.product)[0])

    def along(self, coefficients: Floats) -> float:
        """Inverse variance of a common factor of these parameters."""
        return float(coefficients @ self.precision @ coefficients)

    def gain(self, coefficients: Floats) -> float:
        """Twice the log-likelihood ratio of these parameters against no effect."""
        return float(2 * coefficients @ self.product - coefficients @ self.precision @ coefficients)


@dataclass(frozen=True, slots=True)
class TwoWitnesses:
    """What power and torques say about the size of a finding, in units of that size."""

    power: float
    """Inverse variance of the size, by power alone."""
    torques: float
    power_says: float = 1.0
    """The size, by power alone."""
    torques_say: float = 1.0


@dataclass(frozen=True, slots=True)
class Differences:
    """What unchanged sessions differ by in torques, in units of a finding."""

    sizes: Floats
    """[sessions] of the reference, each by a base model that knows the others."""
    information: Floats
    """[sessions] inverse variance of a size in white noise."""
    usual: float
    """Standard deviation before any were compared."""


class Witness:
    """Logged torques of the reference and of the recordings in question."""

    def __init__(self, observed: Observed, learning_rate: float | None = None) -> None:
        """`learning_rate` None: by the reference sessions."""
        self.observed = observed
        layout, names = observed.layout, sorted({each.session for each in observed.rows})
        self.sessions = [observed.session(name) for name in names]
        self._random = layout.of_a_session
        friction = THRESHOLDS.friction_spread * np.abs(observed.beta)
        usual = np.where(np.arange(len(observed.beta)) < layout.part("offset").stop, 0.2 * observed.deviation, friction)
        self._deviation = random_deviations(self.sessions, self._random, observed.deviation, usual[self._random])
        self._reference = [session for session in self.sessions if not session.in_question]
        self._marginal = {s.name: s.marginal_base(self._random, self._deviation) for s in self.sessions}
        self._cache: dict[_Key, dict[str, Products]] = {}
        self.learning_rate = self._calibrated() if learning_rate is None else learning_rate

    @classmethod
    def of(
        cls, model: GreyBox, robot: RobotDescription, segments: list[tuple[Segment, bool]], scenes: Sequence[Scene]
    ) -> Witness | None:
        """`segments` with whether they are in question, and their scenes; None without torques on both sides."""
        observed = Observed.of(model, robot, segments, scenes)
        return None if observed is None else cls(observed)

    def common_and_own(self, session: Session) -> Floats:
        """[b] parameters of the base model in a session: common ones, and its own zeros and friction."""
        inner = session.base[self._random, self._random] + np.diag(self._deviation**-2.0)
        parameters = self.observed.beta.copy()
        parameters[self._random] += np.linalg.solve(inner, session.residual[self._random])
        return parameters

    def given(self, effect_id: str, variant: Variant) -> Witness:
        """The witness of what remains with an effect of any size in each session in question."""
        effect = library()[effect_id]
        mix = np.eye(len(variant.place.columns)) if variant.place.mix is None else variant.place.mix
        columns = {
            k: effect_columns(effect, scene, variant.shape)[:, :, list(variant.place.columns)] @ mix
            for k, scene in self.observed.scenes.items()
        }
        return Witness(self.observed.with_base_columns(columns), self.learning_rate)

    def sees(self, effect_id: str) -> bool:
        """Whether an effect shows in the logged torques, with columns that follow from motion."""
        effect = library()[effect_id]
        at_sensor = effect.at_link or self.observed.layout.side == "motor"
        return effect.acts_on == "torque" and not effect.detected and at_sensor

    def information(self, effect_id: str, variant: Variant, weights: dict[str, float], *, scanned: bool) -> Information:
        """About the parameters of an effect, from sessions in question and how often each counts.

        `scanned`: the variant's columns index all scanned shapes side by side; else those of its own shape.
        """
        asked = [each for each in self.sessions if each.in_question and weights.get(each.name, 0.0) > 0]
        counted = [(each, weights[each.name]) for each in asked]
        return self._about(effect_id, variant, counted, self._reference, self.learning_rate, scanned=scanned)

    def differences(
        self, effect_id: str, variant: Variant, weights: dict[str, float], coefficients: Floats, *, scanned: bool
    ) -> Differences:
        """Of sizes in units of `coefficients` [k]; the other arguments as in `information`.

        Before any were compared, the mean square of z in a session is `usual_dispersion`, as for the learning rate.
        """
        known = self.information(effect_id, variant, weights, scanned=scanned).along(coefficients)
        a_session = known / (self.learning_rate * max(sum(weights.values()), 1e-9))
        sizes, information = [], []
        for session in self._reference if len(self._reference) > 1 else []:
            others = [other for other in self._reference if other is not session]
            found = self._about(effect_id, variant, [(session, 1.0)], others, 1.0, scanned=scanned)
            if found.along(coefficients) > _LEAST_SHARE * a_session:
                information.append(found.along(coefficients))
                sizes.append(float(coefficients @ found.product) / information[-1])
        usual = np.sqrt((THRESHOLDS.usual_dispersion - 1) / max(a_session, 1e-12))
        return Differences(np.array(sizes), np.array(information), float(usual))

    def _about(
        self, effect_id: str, variant: Variant, counted: list[tuple[Session, float]], reference: list[Session],
        rate: float, *, scanned: bool,
    ) -> Information:  # fmt: skip
        """From sessions and how often each counts, beside the base model of a reference."""
        products = self._products(effect_id, None if scanned else variant)
        columns = list(variant.columns if scanned else variant.place.columns)
        mix = np.eye(len(columns)) if variant.place.mix is None else variant.place.mix
        chosen = [(session, products[session.name].taken(columns), weight) for session, weight in counted]
        S, h = self._schur(chosen, reference, len(columns))
        ratio = self.observed.ratio
        return Information(rate * ratio**2 * mix.T @ S @ mix, rate * ratio * mix.T @ h)

    def _schur(
        self, chosen: list[tuple[Session, Products, float]], reference: list[Session], size: int
    ) -> tuple[Floats, Floats]:
        """Precision [k, k] and product [k] with base model, zeros and friction integrated out."""
        observed = self.observed
        A, b = np.diag(observed.deviation**-2.0), (observed.mean - observed.beta) * observed.deviation**-2.0
        for session in reference:
            square, product = self._marginal[session.name]
            A, b = A + square, b + product
        total = Products(np.zeros((size, size)), np.zeros((size, len(A))), np.zeros(size))
        for session, products, weight in chosen:
            square, product = self._marginal[session.name]
            A, b = A + weight * square, b + weight * product
            total = total + session.marginal(products, self._random, self._deviation).times(weight)
        solved = np.linalg.solve(A, np.column_stack([total.base.T, b]))
        return total.own - total.base @ solved[:, :-1], total.residual - total.base @ solved[:, -1]

    def _products(self, effect_id: str, variant: Variant | None) -> dict[str, Products]:
        shape = None if variant is None else variant.shape
        key = effect_id, None if shape is None else tuple(sorted(shape.items()))
        if key not in self._cache:
            effect = library()[effect_id]
            columns = {k: effect_columns(effect, scene, shape) for k, scene in self.observed.scenes.items()}
            self._cache[key] = self.observed.products(columns)
        return self._cache[key]

    def _calibrated(self) -> float:
        """Learning rate: the inverse of the mean square of z of all effects in reference sessions, left out in turn.

        Few sessions say little about it; a cautious value counts as some more sessions.
        """
        surprises = []
        for session in self._reference:
            others = [other for other in self._reference if other.name != session.name]
            z = [z for effect_id in library() if self.sees(effect_id) for z in self._z(effect_id, session, others)]
            if others and z:
                surprises.append(max(float(np.mean(np.square(z))), 1.0))
        weight = THRESHOLDS.few_sessions
        mean = (weight * THRESHOLDS.usual_dispersion + sum(surprises)) / (weight + len(surprises))
        return 1.0 / mean

    def _z(self, effect_id: str, session: Session, others: list[Session]) -> list[float]:
        """Estimates of single parameters over their standard errors, which an unchanged session should have at 0."""
        scene = next(iter(self.observed.scenes.values()))
        products = self._products(effect_id, None)[session.name]
        z = []
        for variant in library()[effect_id].variants(scene):
            if variant.size > 1 or variant.place.mix is not None:
                continue
            S, h = self._schur([(session, products.taken(list(variant.columns)), 1.0)], others, 1)
            if S[0, 0] > _LEAST_SHARE * max(products.own[variant.columns[0], variant.columns[0]], 1e-9):
                z.append(float(h[0] / np.sqrt(S[0, 0])))
        return z
