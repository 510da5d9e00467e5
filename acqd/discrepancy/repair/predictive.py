"""The held-out test: how well a model predicts the rows of recordings that took no part.

Twice the log predictive density, up to a constant: the white squared error of rows, with a random level of every minute
integrated out, so that a load that the recordings share with the reference decides nothing. What the regression leaves
free beside the effects (friction and losses of the base model, level and clock of the session) has the posterior that
the reference gives it: a base model that is wrong in another motion decides nothing
either (ADR 26).
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.optimize import minimize_scalar

from acqd.arrays import Floats
from acqd.discrepancy.loads.common import CommonLoad
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import Regression
from acqd.discrepancy.regression.setup import LEAST_LEVEL_W
from acqd.discrepancy.selection.accepted import Selected, Selection
from acqd.discrepancy.selection.ranking import prior_deviations
from acqd.models.augmented import Augmented
from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows_at
from acqd.models.effects.scene import Scene, segment_scene
from acqd.models.greybox.model import GreyBox
from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener

_LOG_FACTORS = (-9.0, 0.0)
"""Of a common factor of prior deviations: from nothing to the deviation of a candidate."""


@dataclass(frozen=True, slots=True)
class Beside:
    """What is uncertain beside the level of a minute, on the held-out segments."""

    regression: Regression
    """With all selected effects."""
    owners: dict[tuple[str, str], str]
    """Owner of an effect's columns by its id and place."""
    columns: tuple[NDArray[np.float32], ...]
    """[T, free] W per segment."""
    effects: dict[tuple[str, str], tuple[Floats, ...]]
    """[T, parameters] W per unit and segment, of every effect that can be predicted."""
    lacks: tuple[Floats, ...]
    """[T] W per segment that the base model lacks by the reference."""
    covariance: Floats
    """[free, free] of the coefficients of the free columns by the reference."""

    @classmethod
    def of(cls, selection: Selection, subject: Subject) -> Beside:
        """Of a selection, on the subject's held-out segments."""
        columns, regression = selection.design.columns, selection.regression
        fixed = columns.scenes.memory(columns.scenes.in_question.index(True))  # of all scenes but for their session
        begins = subject.begins
        owners = {(each.id, each.place.where): each.key for each in selection.effects}
        width = 1 + max(int(each.indices.max()) for each in columns.candidates if each.id)
        free = np.array([
            number for number, each in enumerate(regression.columns)
            if not each.block_intercept and not each.varies and each.owner not in owners.values() and each.index < width
            and (each.gate * columns.in_question).any()
        ], dtype=int)  # fmt: skip
        predictable = [each for each in selection.effects if library()[each.id].predictable]
        effects: dict[tuple[str, str], list[Floats]] = {(each.id, each.place.where): [] for each in predictable}
        rows: list[NDArray[np.float32]] = []
        for segment in subject.held_out:  # one scene after the other: together they take more than their columns
            scene = segment_scene(subject.carrier, segment)
            scene.memory.update(fixed | {"origin_s": begins[segment.session], "worked_s": segment.worked_s})
            rows.append(columns.named(scene)[:, regression.indices[free]])
            for each in predictable:
                effects[each.id, each.place.where].append(_columns(each, scene))
            scene.moved.clear()  # torques of bodies, before the next scene
        known = {place: tuple(of_place) for place, of_place in effects.items()}
        bare = regression
        for owner in owners.values():
            bare = bare.without(owner)
        normal, product = bare.normal(1 - columns.in_question)
        endless = free[np.isinf([regression.columns[k].deviation for k in free])]
        priors = prior_deviations(selection.design, regression.indices[endless])
        pull = _shared_prior(normal, product, endless, priors, selection.rows.learning_rate)
        factor = cho_factor(normal + np.diag(pull))
        beta = cho_solve(factor, product)[free]
        lacks = tuple(of_free @ beta for of_free in rows)
        return cls(regression, owners, tuple(rows), known, lacks, _inverse(factor, free))

    def given(self, effects: Collection[tuple[str, str]]) -> tuple[Iterator[Floats], Floats]:
        """Beside some effects (id and place).

        [T, k] W per segment of all uncertain columns, and the covariance [k, k] of their coefficients: those of the
        base by the reference, those of effects by the recordings in question.
        """
        chosen = self.regression
        for place, owner in self.owners.items():
            chosen = chosen if place in effects else chosen.without(owner)
        known = [place for place in self.effects if place in effects]
        owned = [k for place in known for k, c in enumerate(chosen.columns) if c.owner == self.owners[place]]
        whole = cho_factor(chosen.normal(np.ones(len(chosen.blocks)))[0])
        uncertain = (
            np.column_stack([columns, *(self.effects[place][k] for place in known)])
            for k, columns in enumerate(self.columns)
        )
        return uncertain, block_diag(self.covariance, _inverse(whole, owned))


def _shared_prior(normal: Floats, product: Floats, free: Indices, priors: Floats, rate: float) -> Floats:
    """[columns] precision of the columns that are `free` in the regression: what the reference says of them together.

    Minutes of a reference leave many of them open, and another motion shows what they leave: hundreds of W. Their
    deviations are those of candidates, `priors` [free], times the factor of the largest marginal likelihood (ADR 108).
    """
    precision = np.zeros(len(product))
    precision[free] = priors**-2.0

    def unlikely(log_factor: float) -> float:
        factor = cho_factor(rate * normal + np.diag(precision * np.exp(-2 * log_factor)))
        explained = rate**2 * float(product @ cho_solve(factor, product))
        return 2 * float(np.log(np.diag(factor[0])).sum()) + 2 * len(free) * log_factor - explained

    best = minimize_scalar(unlikely, bounds=_LOG_FACTORS, method="bounded").x
    return precision * float(np.exp(-2 * best)) / rate


def _inverse(factor: tuple[Floats, bool], chosen: Sequence[int] | Indices) -> Floats:
    """[k, k] rows and columns of the inverse of a matrix."""
    size = len(factor[0])
    return np.asarray(cho_solve(factor, np.eye(size)[:, list(chosen)])[list(chosen)])


def _columns(selected: Selected, scene: Scene) -> Floats:
    """[T, parameters] W per unit of a selected effect."""
    place, effect = selected.place, library()[selected.id]
    mix = np.eye(len(place.columns)) if place.mix is None else place.mix
    weights = mix @ selected.finding.coefficients
    return np.asarray(effect_rows_at(effect, scene, selected.shape, place.columns, weights) @ mix)


@dataclass(frozen=True, slots=True)
class Predictive:
    """The noise of a selection, and what is uncertain besides."""

    whitener: Whitener
    level_W: float
    """Standard deviation of the level of a minute."""
    learning_rate: float
    beside: Beside | None = None
    """None where the model that is asked about is not the base of the regression."""
    load: CommonLoad | None = None
    """That switches on both sides."""

    @classmethod
    def of(cls, selection: Selection, subject: Subject) -> Predictive:
        """With the noise model and the random intercepts of the selection."""
        levels = [column.deviation for column in selection.regression.columns if column.block_intercept]
        model = subject.model.base if isinstance(subject.model, Augmented) else subject.model
        known = subject.question == "change" and isinstance(model, GreyBox)
        beside = Beside.of(selection, subject) if known else None
        load, level_W = selection.design.columns.load, levels[0] if levels else 0.0
        return cls(selection.design.whitener, level_W, selection.rows.learning_rate, beside, load)

    def without_load(self, errors: list[Floats]) -> list[Floats]:
        """Errors [T] W of the held-out segments without the power of the common load, as these errors show the load.

        In the errors of a model without an effect, the load's states would be those of load and effect together.
        """
        if self.load is None:
            return errors
        power = self.load.power(self.of_change(errors))
        return [own - on for own, on in zip(errors, power, strict=True)]

    def of_change(self, errors: list[Floats]) -> list[Floats]:
        """Errors [T] W of the held-out segments without what the base model lacks in this motion by the reference.

        A model that has seen one programme is more wrong in another, although nothing has changed.
        """
        if self.beside is None:
            return errors
        return [own - more for own, more in zip(errors, self.beside.lacks, strict=True)]

    def density(self, errors: list[Floats], effects: Collection[tuple[str, str]]) -> float:
        """Twice the log predictive density of errors [T] W of segments, up to a constant.

        `effects`: ids and places of those whose power the errors are without. A normal density of the white errors,
        whose covariance is that of uncertain coefficients c: with Z their white columns, I + Z cov(c) Z' (Woodbury).
        """
        errors = self.without_load(errors)
        uncertain: Iterator[Floats] = (np.zeros((len(each), 0)) for each in errors)
        covariance = np.zeros((0, 0))
        if self.beside is not None:
            uncertain, covariance = self.beside.given(effects)
            errors = self.of_change(errors)
        count = covariance.shape[0]
        rate = self.learning_rate
        squares, product, total = np.zeros((count, count)), np.zeros(count), 0.0
        minutes = (zip(*map(_minutes, each), strict=True) for each in zip(errors, uncertain, strict=True))
        for error, columns in itertools.chain.from_iterable(minutes):
            white, Z = self.whitener.from_start(error), self.whitener.from_start(columns)
            one = self.whitener.from_start(np.ones(len(error)))
            precision = 1 / max(self.level_W, LEAST_LEVEL_W) ** 2 / rate
            shrunk = one / (one @ one + precision)  # the random level is integrated out
            white_left, Z_left = white - shrunk * (one @ white), Z - np.outer(shrunk, one @ Z)
            total += rate * float(white @ white_left)
            squares += rate * Z.T @ Z_left
            product += rate * Z.T @ white_left
        inner = np.eye(count) + covariance @ squares / rate  # a posterior by a likelihood to the power of the rate
        explained = float(product @ np.linalg.solve(inner, covariance @ product / rate))
        return explained - total - float(np.linalg.slogdet(inner)[1])


def _minutes(rows: Floats) -> list[Floats]:
    """[T, ...] per block of at most a minute."""
    return np.array_split(rows, max(1, round(len(rows) / NOISE.block_rows)))
