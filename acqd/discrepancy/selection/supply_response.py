"""What the supply makes of an effect's power: laws of the drives' whole power act on the effect's power too.

A brake chopper that the model lacks burns the power of braking, before and after a payload was added. With the
payload, the same chopper burns more: no second change. The laws that both sides have in common are therefore
computed with the power of the effects that are named already.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Regression
from acqd.discrepancy.selection.accepted import Selected
from acqd.models.effects import library
from acqd.models.effects.effect import Effect, drive_power, effect_rows
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene


def with_loaded_laws(design: Design, regression: Regression, effects: Sequence[Selected]) -> tuple[Design, Regression]:
    """The regression with common laws of the power that includes `effects`, and the design that has their columns.

    Only effects of torques with fitted columns count: the power of others does not pass through the drives.
    """
    through = [
        named for named in effects
        if library()[named.id].acts_on == "torque" and named.finding.candidate.fitted is not None
    ]  # fmt: skip
    laws = _common_laws(design, regression)
    if not through or not laws:
        return design, regression
    columns = [_loaded(design, number, list(laws.values()), through) for number in range(len(design.columns.segments))]
    design, indices = design.with_columns(columns)
    old = dict(zip(laws, indices, strict=True))
    return design, Regression(
        design.blocks,
        [replace(each, index=int(old.get(each.index, each.index))) for each in regression.columns],
    )


def _common_laws(design: Design, regression: Regression) -> dict[int, tuple[Effect, Shape]]:
    """The regression's columns that are laws of the drives' power, with their shapes, by place."""
    in_regression = {column.index for column in regression.columns}
    laws: dict[int, tuple[Effect, Shape]] = {}
    for candidate in design.columns.candidates:
        if candidate.id and candidate.variant is not None and library()[candidate.id].of_drives:
            place = int(candidate.indices[0])
            if place in in_regression:
                laws[place] = library()[candidate.id], candidate.variant.shape
    return laws


def _loaded(design: Design, number: int, laws: list[tuple[Effect, Shape]], effects: list[Selected]) -> Floats:
    """[T, laws] W per unit of every law's parameter in a segment, with the effects that act there."""
    scene = design.columns.scenes[number]
    power = sum(
        (_power(scene, named) for named in effects if _acts(design, number, named)), np.zeros(len(scene.drives))
    )
    loaded = replace(scene, drives=scene.drives + power, computed={})
    return np.column_stack([effect_rows(law, loaded, shape)[:, 0] for law, shape in laws])


def _acts(design: Design, number: int, named: Selected) -> bool:
    pairs = zip(design.parts, named.gate.open, strict=True)
    return any(own and part.segment == number for part, own in pairs)


def _power(scene: Scene, named: Selected) -> Floats:
    """[N] W at the drives."""
    fitted = named.finding.candidate.fitted
    assert fitted is not None
    mix = np.eye(len(fitted.place.columns)) if fitted.place.mix is None else fitted.place.mix
    return drive_power(library()[named.id], scene, named.shape, fitted.place.columns, mix @ named.finding.coefficients)
