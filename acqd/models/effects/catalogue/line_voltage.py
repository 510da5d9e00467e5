"""Power that follows the mains voltage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import LARGEST_EXPONENT, LARGEST_LOAD_W, LEAST_EXPONENT
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox

NOMINAL_V = (100.0, 120.0, 230.0, 400.0)
"""Nominal voltages of mains (IEC 60038), coarse: the effect only needs a fixed reference near the measured voltage."""
_ASSUMED_V = 230.0


class LineVoltage(Effect):
    """Power that changes with the mains voltage relative to a nominal voltage, for all loads or a constant load.

    A term keeps the nominal voltage, so that prediction of a row, of a recording and by an FMU use the same one.
    """

    id = "line_voltage"
    cause = Cause.DRIVES
    summary = "power follows the mains voltage: a linear supply or a heater among the loads"
    equation = "P = k P_model (V / V_n - 1)"
    neighbours = ("meter_gain", "offset_shift")
    experiment = "record an hour at rest with the mains voltage"
    needs = ("Vrms",)
    acts_on = "meter"
    c_body = """
    power = (volts / nominal_V - 1.0) * (c[0] * predicted + c[1]);
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[T, 2] W per unit of exponent, and per W of a constant load."""
        assert scene.volts is not None
        nominal = shape.get("nominal_V") or scene.memory.get("nominal_V") or nominal_voltage([scene.volts])
        deviation = np.nan_to_num(scene.volts / nominal - 1)
        return np.column_stack([deviation * scene.predicted, deviation])

    def places(self, scene: Scene) -> Iterator[Place]:
        """All loads, or a constant load."""
        yield Place("all loads", (0,), (Parameter("exponent", "-", LEAST_EXPONENT, LARGEST_EXPONENT),))
        most_W = LARGEST_EXPONENT * LARGEST_LOAD_W
        yield Place("a constant load", (1,), (Parameter("power per relative voltage", "W", -most_W, most_W),))

    def fixed_shape(self, scenes: Sequence[Scene]) -> dict[str, float]:
        """The nominal voltage of the recordings."""
        return {"nominal_V": nominal_voltage([scene.volts for scene in scenes if scene.volts is not None])}

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Nominal voltage; 230 V for a term of an older version, which did not keep it."""
        return {"nominal_V": float(shape.get("nominal_V", _ASSUMED_V))}

    def assumption(self, shape: Shape) -> str:
        """For a bundle of an older version, which does not hold the nominal voltage."""
        if "nominal_V" in shape:
            return ""
        missing = f"the bundle does not hold the nominal voltage, {_ASSUMED_V:.0f} V is assumed"
        return f"{self.id}: {missing}; close the loop again"


def nominal_voltage(volts: Sequence[Floats]) -> float:
    """The nominal voltage nearest to the median measured voltage on a logarithmic scale; 230 V without measurements."""
    measured = np.concatenate(list(volts)) if volts else np.empty(0)
    measured = measured[np.isfinite(measured) & (measured > 0)]
    if not len(measured):
        return _ASSUMED_V
    return min(NOMINAL_V, key=lambda nominal: abs(float(np.log(np.median(measured) / nominal))))
