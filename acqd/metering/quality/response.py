"""Frequency response of the transformers of a channel, taken out of its spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering.quality.spectrum import Lines


@dataclass(frozen=True, slots=True)
class Response:
    """What is measured per what there is, by frequency; straight between the points, constant beyond them."""

    hertz: tuple[float, ...]
    """Rising."""
    ratio: tuple[float, ...]
    degrees: tuple[float, ...]
    """Positive: what is measured leads."""

    def at(self, hertz: Floats | float) -> np.ndarray:
        """Complex, of the shape of `hertz`."""
        ratio = np.interp(hertz, self.hertz, self.ratio)
        return np.asarray(ratio * np.exp(1j * np.radians(np.interp(hertz, self.hertz, self.degrees))))


Responses = tuple[Response | None, Response | None]
"""Of all voltages and of all currents; None: ideal."""
IDEAL: Responses = (None, None)


def without(responses: Sequence[Response | None], lines: Lines, f_line: float) -> Lines:
    """`lines` [channels, lines], `f_line` Hz apart and in the order U1, I1, U2 ..., as the primary sides have them."""
    if not any(responses):
        return lines
    hertz: Floats = np.arange(lines.shape[1], dtype=np.float64) * f_line
    result = lines.copy()
    for first, response in enumerate(responses):
        if response is not None:
            result[first::2] /= response.at(hertz)
    return result
