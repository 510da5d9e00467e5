"""The wiring of a recording: what its phasors say from the beginning to the end.

Faults, starts of motors and switching turn phasors for a while. So pieces from the whole recording are examined, and
what is said is what their mean and most of the pieces say.
"""

from __future__ import annotations

import numpy as np

from acqd.metering.energy import no_load_W
from acqd.metering.phasors import Phasors, phasors
from acqd.metering.wiring_check import examine
from acqd.metering.wiring_finding import WiringFinding
from acqd.metering.wiring_watch import LOAD, Wired
from acqd.sources.waveform import Waveform

_CYCLES, _FEWEST, _PIECES = 10, 2, 12
"""Cycles of a piece, of the one piece of a short recording, and most pieces."""
_AGREEING = 0.75
"""Share of the pieces that must say the same."""
_PURE = 0.5
"""Share of the RMS that the fundamental must have: else mains are not at this frequency, and angles mean nothing."""


def wired(waveform: Waveform) -> Wired:
    """Mean phasors, and what they say; nothing without mains and load."""
    looks = [found for part in _pieces(waveform) if (found := _look(waveform, part)) is not None]
    if not looks:
        return Wired()
    mean = Phasors(np.mean([one.U for one in looks], axis=0), np.mean([one.I for one in looks], axis=0))
    findings = tuple(examine(mean))
    if not findings:
        return Wired(mean)
    agreeing = sum(_mistakes(examine(one)) == _mistakes(findings) for one in looks)
    return Wired(mean, findings if agreeing >= _AGREEING * len(looks) else ())


def _mistakes(findings: list[WiringFinding] | tuple[WiringFinding, ...]) -> list[str]:
    return [one.mistake.partition(",")[0] for one in findings]  # without what explains the phasors as well


def _pieces(waveform: Waveform) -> list[slice]:
    form, samples = waveform.form, len(waveform.codes)
    cycle = form.rate / form.f_nominal
    length = round(cycle * max(_FEWEST, min(_CYCLES, int(samples / cycle))))
    number = min(_PIECES, samples // length)
    return [slice(begin, begin + length) for begin in np.linspace(0, samples - length, number).astype(int).tolist()]


def _look(waveform: Waveform, part: slice) -> Phasors | None:
    """Phasors of a piece; None where no mains or no load is there."""
    form = waveform.form
    values = waveform.codes[part] * np.array(form.scale)
    found = phasors(values, form.rate, form.f_nominal)
    rms = np.sqrt((values * values).mean(axis=0))
    volts = float(np.abs(found.U).max())
    least = LOAD * no_load_W(form, volts) / volts if volts else 0.0
    pure = volts > _PURE * rms[0::2].max() and np.abs(found.I).max() > _PURE * rms[1::2].max()
    return found if volts and pure and np.abs(found.I).max() > least else None
