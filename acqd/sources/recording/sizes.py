"""Do the sizes of voltages and currents fit a network? Hints, where a scale or a role may be wrong: never a correction.

Three voltages that are called A, B, C may be those between lines. Networks have standard voltages (IEC 60038): one of
230/400 V has no 400 V to neutral, but 230 V are both, to neutral there and between lines in one of 127/220 V.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acqd.metering.block import Codes
from acqd.sources.recording.label import says_to_neutral
from acqd.sources.recording.neutral_or_lines import Compared, compare

_DEAD_V, _DEAD_A = 10.0, 1e-6
"""Peak of a channel without mains, or with a wrong scale: below it a transformer has nothing to measure."""
_MOST_V, _MOST_A = 800e3, 300e3
"""RMS beyond every network: 1200 kV between lines are 693 kV to neutral; a short circuit has up to 200 kA."""
_LOW_V = ((95.0, 130.0), (190.0, 260.0), (370.0, 750.0))
"""Voltages of three phases that low-voltage networks and secondary circuits have between lines (100 to 120, 200 to 240,
380 to 690 V and a tenth more or less). Some of them others have to neutral: 120, 230, 400 V."""
_SECONDARY_V = (50.0, 75.0)
"""Voltages to neutral behind voltage transformers: 100, 110, 115 and 120 V between lines (IEC 61869-3)."""
_HIGH_KV = (
    *(2.4, 3, 3.3, 4.16, 6, 6.6, 10, 11, 13.8, 15, 20, 22, 30, 33, 34.5, 45, 66, 69, 110, 115, 132, 138, 150, 161, 220),
    *(230, 275, 330, 345, 380, 400, 500, 765),
)
_HIGH_V = 1e3 * np.array(_HIGH_KV)
"""Voltages between lines of networks above 1 kV, IEC 60038 and ANSI C84.1."""
_NEAR, _TWICE = 0.06, 2.0
"""Of a standard voltage; and how many times nearer one explanation must be than the other."""
_LOOK = 20_000
"""Samples whose RMS is taken."""


def hints(
    channels: Sequence[tuple[int, str]],
    codes: Codes,
    scale: NDArray[np.float64],
    clock: tuple[float, float],
    roles_by_name: bool,
) -> list[str]:
    """What to ask the user of the channels u, i, u, i ... [samples, channels], `scale` in V or A per number.

    `channels`: numbers and names in the file, in the order of the columns. `clock`: samples/s and nominal f [Hz].
    `roles_by_name`: nobody has said with --map what the channels are.
    """
    names = [name for _, name in channels]
    found = []
    part = codes[:_LOOK].astype(np.float64) * scale
    with np.errstate(over="ignore"):  # whatever a damaged header gives as a scale
        rms, peak = np.sqrt((part * part).mean(axis=0)), np.abs(part).max(axis=0)
        volts = part[:, 0::2].std(axis=0)  # without the mean: a direct voltage comes from no transformer
    for first, quantity, unit, low, high in ((0, "u", "V", _DEAD_V, _MOST_V), (1, "i", "A", _DEAD_A, _MOST_A)):
        ask = f"(--{quantity}-scale)?"
        dead = [k for k in range(first, len(names), 2) if peak[k] < low]
        for k in dead:  # the whole recording, only where its first samples hold nothing
            peak[k] = abs(scale[k]) * max(float(codes[:, k].max()), -float(codes[:, k].min()))
        dead = [k for k in dead if peak[k] < low]
        if dead:
            listed, most = ", ".join(names[k] for k in dead), peak[dead].max()
            found.append(f"{listed}: never above {most:.3g} {unit}; is nothing connected, or is the scale wrong {ask}")
        large = [k for k in range(first, len(names), 2) if rms[k] > high]
        if large:
            listed, most = ", ".join(names[k] for k in large), rms[large].max()
            found.append(f"{listed}: {most:.3g} {unit}, more than any network has; is the scale wrong {ask}")
    if _SECONDARY_V[0] < volts.min() and volts.max() < _SECONDARY_V[1]:
        found.append(
            f"{', '.join(names[0::2])}: {volts.mean():.4g} V, as behind voltage transformers of 100 to 120 V; are "
            "these values secondary, without a ratio (--u-scale, --i-scale)?"
        )
    if roles_by_name and len(names) == 6 and rms.max() <= _MOST_V and not all(map(says_to_neutral, names[0::2])):
        found += _line_voltages(channels, compare(codes, scale, *clock))
    return found


def _line_voltages(channels: Sequence[tuple[int, str]], compared: Compared | None) -> list[str]:
    """A hint where voltages that are metered as those to neutral have the size of those between lines."""
    if compared is None:
        return []
    size = compared.size_V
    as_lines, as_phases = _distance(size), _distance(size * np.sqrt(3))
    high = size > 2e3 and as_lines <= _NEAR and as_phases >= _TWICE * as_lines
    if not high and not any(low < size < top for low, top in _LOW_V):
        return []
    names, k = ", ".join(name or str(number) for number, name in channels[0::2]), [number for number, _ in channels]
    lines = f"u12={k[0]},u23={k[2]},u31={k[4]},i1={k[1]},i2={k[3]},i3={k[5]}"
    phases = ",".join(f"{key}={number}" for key, number in zip(("u1", "i1", "u2", "i2", "u3", "i3"), k, strict=True))
    return [
        f"{names} have {size:.4g} V and are metered as voltages to neutral; voltages between lines have that size too "
        f"({compared.words()}). Say which: --map {phases} to neutral, --map {lines} between lines"
    ]


def _distance(value: float) -> float:
    """From the nearest standard voltage between lines, as a share."""
    return float(np.abs(_HIGH_V / value - 1).min())
