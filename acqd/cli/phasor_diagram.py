"""Phasors of three phases as characters, and as lines of numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

_ROWS, _COLUMNS = 17, 41  # characters are twice as high as wide
_SHORT = 0.6  # arrows of currents, so that they do not hide those of voltages


def diagram(phasors: dict[str, list[list[float]]]) -> str:
    """Voltages (`U1`, dots) and currents (`I1`, signs `*`), each scaled to its largest; U1 points to the right."""
    canvas = [[" "] * _COLUMNS for _ in range(_ROWS)]
    for letter, mark, share in (("U", ".", 1.0), ("I", "*", _SHORT)):
        values = phasors[letter]
        largest = max(size for size, _ in values) or 1.0
        for k, (size, degrees) in enumerate(values, start=1):
            _arrow(canvas, share * size / largest, degrees, mark, f"{letter}{k}")
    canvas[_ROWS // 2][_COLUMNS // 2] = "+"
    return "\n".join("".join(row).rstrip() for row in canvas)


def _arrow(canvas: list[list[str]], length: float, degrees: float, mark: str, label: str) -> None:
    for step in range(1, 25):
        row, column = _place(length * step / 24, degrees)
        if canvas[row][column] == " ":
            canvas[row][column] = mark
    row, column = _place(length, degrees)
    first = min(column, _COLUMNS - len(label))
    canvas[row][first : first + len(label)] = label


def _place(length: float, degrees: float) -> tuple[int, int]:
    angle = math.radians(degrees)
    row = _ROWS // 2 - round(length * (_ROWS // 2) * math.sin(angle))
    return row, _COLUMNS // 2 + round(length * (_COLUMNS // 2 - 1) * math.cos(angle))


def lines(phasors: dict[str, list[list[float]]]) -> Sequence[str]:
    """One line per phase."""
    found = []
    for k, ((volts, angle), (amperes, other)) in enumerate(zip(phasors["U"], phasors["I"], strict=True), start=1):
        lag = (angle - other + 180) % 360 - 180
        found.append(f"L{k}: {volts:.5g} V at {angle:.1f}°, {amperes:.4g} A at {other:.1f}°: I lags U by {lag:.1f}°")
    return found


def print_wiring(wired: dict[str, Any]) -> None:
    """What `Wired.as_dict` holds, for people."""
    if wired["phasors"]:
        print(diagram(wired["phasors"]))
        for line in lines(wired["phasors"]):
            print(line)
    for phase, values in wired.get("readings", {}).items():
        print(f"{phase}: " + ", ".join(f"{name} {value:.5g}" for name, value in values.items() if value is not None))
    for finding in wired["findings"]:
        print(f"wiring: {finding['text']}" + (f"; {finding['correction']}" if finding["correction"] else ""))
    if wired.get("note"):
        print(f"wiring: {wired['note']}")
    elif not wired["findings"]:
        print(f"wiring: nothing is wrong that {'phasors show' if wired['phasors'] else 'the power shows'}")
