"""The chart of logged joint torques: what changes at the joints need not show in the power.

A torque at rest costs next to nothing, and the power of a motion returns when the motion does: an encoder that is off
by three degrees, or a torque sensor by a newton metre, leaves the power as it was. One chart of the joint that deviates
most has fewer false alarms than a chart per joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.augmented import Augmented
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.monitor.blocks import Blocks, Scale
from acqd.monitor.bound import bound
from acqd.monitor.thresholds import MONITOR
from acqd.residual.logged_torque import Side, side_of
from acqd.residual.motion_torque import JointRows, fitted, unseen_residuals

_FOLDS = 5
_FEWEST_RECORDINGS = 3
_LEAST_SPREAD = 0.05


def grey_box_of(model: Predictor) -> GreyBox | None:
    """The grey box on whose dynamics a model is built; None for a network alone."""
    if isinstance(model, Augmented):
        return model.carrier
    if isinstance(model, Hybrid):
        return model.grey
    return model if isinstance(model, GreyBox) else None


@dataclass(frozen=True, slots=True)
class JointChart:
    """Logged torques of an unchanged robot."""

    model: GreyBox
    side: Side
    parameters: Floats
    """[axes, k], see `motion_torque`."""
    joints: Scale
    """Of the figures of the joints."""
    largest: Scale
    """Of the largest standardised figure."""
    bound: float
    """Of the CUSUM chart."""

    @classmethod
    def of(
        cls, model: GreyBox, segments: Sequence[Segment], blocks: Sequence[Blocks], between_s: float
    ) -> JointChart | None:
        """From recordings and their blocks, in the order of time; `between_s`: mean time between false alarms.

        None without logged torques in at least three recordings, or where they are too short. The scale is that of
        residuals on recordings that the parameters do not know.
        """
        side = side_of(segments)
        if side is None:
            return None
        rows = [(JointRows.of(model, segment, side), own) for segment, own in zip(segments, blocks, strict=True)]
        usable = [(joints, own) for joints, own in rows if joints is not None and own.rows]
        recordings = [joints for joints, _ in usable]
        if len(recordings) < _FEWEST_RECORDINGS:
            return None
        residuals = unseen_residuals(model, side, recordings, _FOLDS)
        figures = np.concatenate([_figures(e, own) for e, (_, own) in zip(residuals, usable, strict=True)])
        kinds = np.concatenate([own.kinds for _, own in usable])
        watched = np.isfinite(figures).sum(axis=0) >= MONITOR.cusum_fewest_blocks
        if not watched.any():
            return None
        figures[:, ~watched] = 0.0
        joints = Scale.of(figures, kinds, np.where(watched, _LEAST_SPREAD, np.inf))
        highest = _largest(joints.standardised(figures, kinds))
        known = np.isfinite(highest)
        largest = Scale.of(highest[:, None], kinds, np.array([_LEAST_SPREAD]))
        z = _clipped(largest.standardised(highest[:, None], kinds)[known, 0])
        parameters = fitted(model, side, np.sum([each.products() for each in recordings], axis=0))
        return cls(model, side, parameters, joints, largest, bound(z, between_s / MONITOR.cusum_block_s))

    def charted(self, segment: Segment, blocks: Blocks) -> tuple[Floats, NDArray[np.intp]]:
        """[n] increments of the chart per block, NaN without torques, and the joints (from 1) that deviate most."""
        rows = JointRows.of(self.model, segment, self.side)
        if rows is None:
            return np.full(len(blocks.rows), np.nan), np.zeros(len(blocks.rows), dtype=np.intp)
        standardised = self.joints.standardised(_figures(rows.residual(self.parameters), blocks), blocks.kinds)
        z = _clipped(self.largest.standardised(_largest(standardised)[:, None], blocks.kinds)[:, 0])
        return z, np.where(np.isnan(standardised), -np.inf, standardised).argmax(axis=1) + 1


def _figures(residual: Floats, blocks: Blocks) -> Floats:
    """[n, axes]: log of the mean square of a residual [T, axes] per block; NaN where less than a quarter is known."""
    figures = np.full((len(blocks.rows), residual.shape[1]), np.nan)
    for number, rows in enumerate(blocks.rows):
        inner = residual[rows]
        known = np.isfinite(inner)
        enough = known.sum(axis=0) >= len(inner) / 4
        square = np.where(known, inner, 0.0) ** 2
        mean = square.sum(axis=0)[enough] / known.sum(axis=0)[enough]
        figures[number, enough] = np.log(np.maximum(mean, 1e-12))
    return figures


def _largest(standardised: Floats) -> Floats:
    """[n] of figures [n, axes]; NaN where none is known."""
    highest = np.where(np.isnan(standardised), -np.inf, standardised).max(axis=1)
    return np.where(np.isfinite(highest), highest, np.nan)


def _clipped(z: Floats) -> Floats:
    return np.asarray(np.clip(z, -MONITOR.cusum_clip, MONITOR.cusum_clip))
