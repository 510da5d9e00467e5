"""Do the samples follow each other without a break? Filled gaps, missing or repeated stretches, a switched range.

A phasor a cycle shows it: the angle of a voltage runs on evenly, with all phases alike. A fault in the network changes
its size as well, and phases differently. These are questions to the user; only held values are no measurements for
certain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.block import Codes, StreamFormat
from acqd.sources.waveform import QUANTITIES

_WAVE_CYCLES, _SIGNS, _VALUES = 2, 3, 5
"""Beside a stretch that stands still, where a wave is: changes of sign in so many cycles, and different values."""
_JUMP_deg, _ALIKE_deg, _STEADY_deg = 8.0, 3.0, 2.0
"""A jump of the angle from a cycle to the next but one; how alike phases jump; how steady f is around."""
_SAME_SIZE = 0.03
"""Of the size of a voltage before and after a jump."""
_ALIVE = 0.3
"""Of the largest phasor of a channel: below it there is nothing to compare."""
_RANGE = 1.9
"""Times the voltage: with an earth fault healthy phases rise by sqrt(3), and no more for long."""
_AROUND = 3
"""Cycles before and after a jump that are compared."""
_POINTS = 40
"""Samples of a cycle that its phasor is made of, at least."""
_SHOWN = 3
Breaks = Sequence[tuple[int, int]]


def held(x: Codes, least: int, far: float, cycle: int) -> list[tuple[int, int]]:
    """Stretches of a channel of at least `least` equal samples beyond `far` amid waves: (first, after the last).

    Nearer to zero a channel may stand still because nothing flows; without waves it may be a direct quantity.
    """
    step = max(1, least // 2)
    few = x[::step]
    equal = few[1:] == few[:-1]
    equal &= x[step // 2 :: step][: len(equal)] == few[:-1]
    candidates = np.flatnonzero(equal)
    if not len(candidates) or len(candidates) == len(equal):
        return []
    found: list[tuple[int, int]] = []
    for at in (candidates * step).tolist():
        if (found and at < found[-1][1]) or abs(float(x[at])) < far or (x[at : at + step] != x[at]).any():
            continue
        begin, end = at, at + step
        while begin and x[begin - 1] == x[at]:
            begin -= 1
        while end < len(x) and x[end] == x[at]:
            end += 1
        if end - begin >= least and _amid_waves(x, begin, end, far, cycle):
            found.append((begin, end))
    return found


def _amid_waves(x: Codes, begin: int, end: int, far: float, cycle: int) -> bool:
    """Whether the channel alternates before and after a stretch, where the recording has cycles there."""
    size = _WAVE_CYCLES * cycle
    sides = [side for side in (x[max(0, begin - size) : begin], x[end : end + size]) if len(side) == size]
    return bool(sides) and all(_is_wave(side, far) for side in sides)


def _is_wave(part: Codes, far: float) -> bool:
    signs = np.sign(part[np.abs(part.astype(np.float64)) >= far])
    return int((signs[1:] != signs[:-1]).sum()) >= _SIGNS and len(np.unique(part)) >= _VALUES


def remarks(codes: Codes, form: StreamFormat, breaks: Breaks) -> tuple[str, ...]:
    """What to ask the user; nothing where the recording is shorter than some cycles."""
    cycle = round(form.rate / form.f_nominal)
    if cycle < 8 or len(codes) < 3 * _AROUND * cycle:
        return ()
    lines = _lines(codes[:, 0::2], cycle)
    said = [*_jumps(lines, cycle, form, breaks), *_ranges(lines, cycle, form), *_still(codes, cycle, form.rate)]
    return tuple(said)


def _lines(volts: Codes, cycle: int) -> NDArray[np.complex128]:
    """Phasors [cycles, phases] of consecutive pieces of `cycle` samples, in codes."""
    size = len(volts) // cycle
    step = max(1, cycle // _POINTS)
    angle = 2 * np.pi / cycle * np.arange(0, cycle, step)
    result = np.empty((size, volts.shape[1]), dtype=np.complex128)
    for k in range(volts.shape[1]):
        pieces = volts[: size * cycle, k].reshape(size, cycle)[:, ::step].astype(np.float32)
        turned = np.einsum("ij,jk->ik", pieces, np.stack((np.cos(angle), -np.sin(angle)), 1).astype(np.float32))
        result[:, k] = np.sqrt(2) / len(angle) * (turned[:, 0] + 1j * turned[:, 1])
    return result


def _jumps(lines: NDArray[np.complex128], cycle: int, form: StreamFormat, breaks: Breaks) -> list[str]:
    """Cycles at which all voltages jump by one angle, and keep their size."""
    size = np.abs(lines)
    alive = size.max(axis=0) > 0
    if len(lines) < 2 * _AROUND + 3 or not alive.any():
        return []
    step = np.degrees(np.angle(lines[2:] * lines[:-2].conj()))[:, alive]
    inner = slice(_AROUND, len(step) - _AROUND)
    before, after = step[: -2 * _AROUND], step[2 * _AROUND :]
    turned = _wrapped(step[inner] - before)
    same = np.abs(size[2:] / np.maximum(size[:-2], 1e-30) - 1)[inner][:, alive].max(axis=1) < _SAME_SIZE
    live = (size[2:] > _ALIVE * size.max(axis=0))[inner][:, alive].all(axis=1)
    steady = np.abs(_wrapped(after - before)).max(axis=1) < _STEADY_deg
    alike = np.ptp(_wrapped(turned - turned[:, :1]), axis=1) < _ALIKE_deg
    hits = np.flatnonzero((np.abs(turned).min(axis=1) > _JUMP_deg) & same & live & steady & alike) + _AROUND
    known = {at // cycle + near for at, _ in breaks for near in (-2, -1, 0, 1)}
    places = [at for k, at in enumerate(hits.tolist()) if at not in known and (not k or at > hits[k - 1] + 2)]
    if not places:
        return []
    listed = ", ".join(
        f"{turned[at - _AROUND, 0]:+.0f} degrees at {(at + 1.5) * cycle / form.rate:.2f} s" for at in places[:_SHOWN]
    )
    more = f" and {len(places) - _SHOWN} more times" if len(places) > _SHOWN else ""
    return [f"its voltages jump by an angle ({listed}{more}): are samples missing or repeated there?"]


def _wrapped(degrees: Floats) -> Floats:
    return np.asarray((degrees + 180) % 360 - 180)


def _ranges(lines: NDArray[np.complex128], cycle: int, form: StreamFormat) -> list[str]:
    said = []
    for k in range(lines.shape[1]):
        size = np.abs(lines[:, k]) * abs(form.scale[2 * k])
        first, last = float(np.median(size[:_AROUND])), float(np.median(size[-_AROUND:]))
        if first > 0.2 * last and last > _RANGE * first:
            at = int(np.argmax(size > np.sqrt(first * last)))
            said.append(
                f"{QUANTITIES[2 * k]} goes from {first:.4g} V to {last:.4g} V at {at * cycle / form.rate:.2f} s and "
                "stays there: was a range or probe switched?"
            )
    return said


def _still(codes: Codes, cycle: int, rate: float) -> list[str]:
    """Cycles in which no channel changes, in a recording whose channels do."""
    few = codes[:: max(1, cycle // 4)]
    equal = (few[1:] == few[:-1]).all(axis=1)
    if equal.all() or not equal.any():
        return []
    ends = np.flatnonzero(np.diff(np.concatenate(([0], equal.view(np.int8), [0]))))
    for begin, end in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True):
        first, last = begin * max(1, cycle // 4), end * max(1, cycle // 4)
        if last - first >= cycle and (codes[first:last] == codes[first]).all():
            return [
                f"no channel changes for {(last - first) / rate:.2g} s from {first / rate:.2f} s on: an interruption, "
                "or a gap that was filled?"
            ]
    return []
