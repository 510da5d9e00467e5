"""Scaling of inputs and target for networks (thesis section 7.3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from acqd.arrays import Floats

if TYPE_CHECKING:
    from acqd.models.segments import Segment

_MIN_SCALE = 1e-3  # so that the noise of an axis that hardly moves, or of constant power, is not amplified


@dataclass(frozen=True, slots=True)
class Normalisation:
    """(value - offset) / scale, per axis for q [rad], qd [rad/s] and qdd [rad/s^2], and for P [W]."""

    offset: Floats
    """[3, axes]: q, qd, qdd."""
    scale: Floats
    """[3, axes]."""
    P_offset: float
    P_scale: float

    @classmethod
    def thesis(cls, axes: int) -> Normalisation:
        """The constants of thesis section 7.3.1, for the iiwa."""
        scale = np.repeat([[3.0], [1.6], [13.0]], axes, axis=1)
        return cls(np.zeros((3, axes)), scale, 155.0, 166.0)

    @classmethod
    def fitted(cls, segments: list[Segment], step_s: float) -> Normalisation:
        """Mean and standard deviation of the training segments."""
        quantities = [np.concatenate(parts) for parts in zip(*(s.motion(step_s) for s in segments), strict=True)]
        P = np.concatenate([s.P for s in segments])
        offset = np.array([values.mean(axis=0) for values in quantities])
        scale = np.array([np.maximum(values.std(axis=0), _MIN_SCALE) for values in quantities])
        return cls(offset, scale, float(P.mean()), max(float(P.std()), _MIN_SCALE))

    def inputs(self, order: int, values: Floats) -> Floats:
        """Normalised angles (order 0), velocities (1) or accelerations (2), [..., axes]."""
        return np.asarray((values - self.offset[order]) / self.scale[order])

    def as_json(self) -> dict[str, Any]:
        """The entry of bundle.json."""
        names = ("q_rad", "qd_rad_s", "qdd_rad_s2")
        axes = {
            name: {"offset": self.offset[k].tolist(), "scale": self.scale[k].tolist()} for k, name in enumerate(names)
        }
        return axes | {"P_W": {"offset": self.P_offset, "scale": self.P_scale}}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Normalisation:
        """The inverse of `as_json`."""
        axes = [data[name] for name in ("q_rad", "qd_rad_s", "qdd_rad_s2")]
        return cls(
            np.array([quantity["offset"] for quantity in axes]),
            np.array([quantity["scale"] for quantity in axes]),
            float(data["P_W"]["offset"]),
            float(data["P_W"]["scale"]),
        )
