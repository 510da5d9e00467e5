"""The wiring of a running stream, from phasors of a minute: a warning, never a correction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.energy import no_load_W
from acqd.metering.meter import INTERRUPTION
from acqd.metering.phasors import Phasors, phasors
from acqd.metering.wiring_check import examine
from acqd.metering.wiring_finding import WiringFinding

_EVERY_S = 1.0
_LOOKS = 60
"""Looks, one a second, whose mean is examined."""
_AGREEING = 2
"""Minutes in a row that must say the same: one minute may be one motion of a machine."""
LOAD = 20.0
"""Times the current of a window without load: below it, angles are those of noise and crosstalk."""
_UNMEASURED = frozenset(("gap", "invalid", "overrange", "clipped", "rollover", "saturated"))


@dataclass(frozen=True, slots=True)
class Wired:
    """What the newest minutes say."""

    phasors: Phasors | None = None
    """Means of the last whole minute, or of the looks so far before that."""
    findings: tuple[WiringFinding, ...] = ()

    def as_dict(self, correction: Callable[[WiringFinding], str] | None = None) -> dict[str, Any]:
        """For status, page and JSON: findings with what to paste, phasors as [V or A, degrees] with U1 at 0.

        `correction`: what to paste where channels are corrected already; None: the finding's.
        """
        found = self.phasors
        polar = {} if found is None else {"U": _polar(found.U), "I": _polar(found.I)}
        findings = [
            {"text": one.text, "correction": one.correction if correction is None else correction(one)}
            for one in self.findings
        ]
        return {"findings": findings, "phasors": polar}


def _polar(values: np.ndarray) -> list[list[float]]:
    return [[round(abs(one), 4), round(float(np.degrees(np.angle(one))), 1)] for one in values.tolist()]


class WiringWatch:
    """Looks at one window a second."""

    def __init__(self, form: StreamFormat, nominal_V: float) -> None:
        """`nominal_V`: without mains of this voltage, and without load, nothing is examined."""
        self._form, self._scale = form, np.array(form.scale)
        self._least_V = INTERRUPTION * nominal_V
        self._least_A = LOAD * no_load_W(form, nominal_V) / nominal_V
        self._least = 2 * round(form.rate / form.f_nominal)
        self._every = round(_EVERY_S * form.rate)
        self._next = 0
        self._total, self._looks = np.zeros(len(form.scale), dtype=complex), 0
        self._said: list[tuple[WiringFinding, ...]] = []
        self.wired = Wired()

    def feed(self, block: SampleBlock) -> None:
        """The next samples, after the correction."""
        if block.index < self._next or len(block.codes) < self._least:
            return
        self._next = block.index + self._every
        if block.flags & _UNMEASURED:
            return
        found = phasors(block.codes[-self._least :] * self._scale, self._form.rate, self._form.f_nominal)
        if np.abs(found.U).max() < self._least_V or np.abs(found.I).max() < self._least_A:
            return
        self._total[0::2] += found.U
        self._total[1::2] += found.I
        self._looks += 1
        mean = Phasors(self._total[0::2] / self._looks, self._total[1::2] / self._looks)
        if self._looks < _LOOKS:
            if not self._said:
                self.wired = Wired(mean)
            return
        self._said = [*self._said[1 - _AGREEING :], tuple(examine(mean))]
        agreed = len(self._said) == _AGREEING and len({tuple(one.mistake for one in said) for said in self._said}) == 1
        self.wired = Wired(mean, self._said[-1] if agreed else ())
        self._total[:], self._looks = 0, 0
