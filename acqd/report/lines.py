"""Lines over a common axis, as SVG for wide and for narrow screens, with the values for the pointer."""

from __future__ import annotations

import html
import json
import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.floating[Any]]
Colour = Literal["ink", "before", "after", "muted", "other", "fine"]
MOST_POINTS = 3000
_LEFT, _RIGHT, _TOP, _GAP, _BOTTOM = 62, 8, 6, 14, 40
_ONE_VALUE = 1e-5
"""Values within this share of their size are one: the numbers of the axis, of six digits, would be equal."""
_CHARACTER = 7.5
"""Units that a digit or a letter of an axis takes at most."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line; NaN interrupts it."""

    name: str
    values: Values
    colour: Colour = "ink"


@dataclass(frozen=True, slots=True)
class Panel:
    """Lines with a common vertical axis."""

    label: str
    """Quantity and unit."""
    lines: list[Line]
    height: int = 260
    zero: bool = False
    """Draw a line at zero."""
    bars: bool = False
    """Draw bars from zero: sums over equal spans, of which a single one is a picture, too."""


@dataclass(frozen=True, slots=True)
class Chart:
    """Panels one below another."""

    x: Values
    x_label: str
    """Quantity and unit."""
    panels: list[Panel]
    alt: str
    """What the picture shows, for those who cannot see it."""

    @property
    def legend(self) -> list[Line]:
        """Every name once."""
        lines = [line for panel in self.panels for line in panel.lines]
        return list({line.name: line for line in reversed(lines)}.values())[::-1]

    def thinned(self) -> Chart:
        """Not more than MOST_POINTS points: of equal stretches the extremes of every line, and where it is unknown."""
        if len(self.x) <= MOST_POINTS:
            return self
        lines = [line.values for panel in self.panels for line in panel.lines]
        kept = {0, len(self.x) - 1}
        for stretch in np.array_split(np.arange(len(self.x)), MOST_POINTS // (3 * len(lines)) - 1):
            for values in (line[stretch] for line in lines):
                unknown = np.isnan(values)
                kept |= set(stretch[unknown][:1].tolist())
                if not unknown.all():
                    kept |= {int(stretch[np.nanargmin(values)]), int(stretch[np.nanargmax(values)])}
        rows = np.array(sorted(kept))
        panels = [replace(p, lines=[Line(o.name, o.values[rows], o.colour) for o in p.lines]) for p in self.panels]
        return Chart(self.x[rows], self.x_label, panels, self.alt)

    def values(self) -> str:
        """JSON for script.js, safe within a script element: x, and the values of every line."""
        names = [f"{line.name} {panel.label}" for panel in self.panels for line in panel.lines]
        rows = [_rounded(line.values) for panel in self.panels for line in panel.lines]
        text = json.dumps({"x": _rounded(self.x), "label": self.x_label, "names": names, "rows": rows})
        return text.replace("<", "\\u003c")

    def svg(self, width: int, scale: float = 1.0) -> str:
        """An SVG element, `width` units wide; `scale` multiplies the heights of the panels."""
        drawing = _Drawing(self, width, scale)
        label = html.escape(self.alt)
        return (
            f'<svg role="img" aria-label="{label}" viewBox="0 0 {width} {drawing.height}" '
            f'data-from="{drawing.first:g}" data-to="{drawing.last:g}" preserveAspectRatio="xMidYMid meet">'
            f"{drawing.text}</svg>"
        )


class _Drawing:
    """One chart at one width."""

    def __init__(self, chart: Chart, width: int, scale: float) -> None:
        self.width = width
        self.bar = _bar_width(chart)
        self.x_range = float(chart.x[0]) - self.bar / 2, float(chart.x[-1]) + self.bar / 2
        heights = [max(round(panel.height * scale), _label_height(panel)) for panel in chart.panels]
        scales = [_scale(panel, height) for panel, height in zip(chart.panels, heights, strict=True)]
        longest = max((len(f"{tick:g}") for _, _, own in scales for tick in own), default=0)
        self.left = max(_LEFT, math.ceil(_LEFT + (longest - 4) * _CHARACTER))  # beside the label of the axis
        self.first, self.last = (float(place) for place in self._x(chart.x[[0, -1]]))
        top, parts = _TOP, []
        for panel, axis, height in zip(chart.panels, scales, heights, strict=True):
            parts.append(self._panel(chart, panel, axis, top, height))
            top += height + _GAP
        bottom = top - _GAP
        self.height = bottom + _BOTTOM
        parts.append(self._x_axis(chart, bottom))
        parts.append(f'<line class="cursor" x1="0" x2="0" y1="{_TOP}" y2="{bottom}"/>')
        self.text = "".join(parts)

    def _x(self, values: Values) -> Values:
        low, high = self.x_range
        return self.left + (values - low) / max(high - low, 1e-12) * (self.width - self.left - _RIGHT)

    def _panel(self, chart: Chart, panel: Panel, axis: _Axis, top: int, height: int) -> str:
        low, high, marks = axis
        parts = []
        for tick in marks:
            y = round(top + (high - tick) / (high - low) * height, 1)
            kind = "axis" if (panel.zero or panel.bars) and tick == 0 else "grid"
            parts.append(f'<line class="{kind}" x1="{self.left}" x2="{self.width - _RIGHT}" y1="{y}" y2="{y}"/>')
            parts.append(f'<text x="{self.left - 6}" y="{y + 4}" text-anchor="end">{tick:g}</text>')
        x = self._x(chart.x)
        for line in panel.lines:
            heights = np.round(top + (high - line.values) / (high - low) * height, 1)
            if panel.bars:
                half = 0.4 * (self._x(chart.x[:1] + self.bar)[0] - x[0])
                foot = round(top + high / (high - low) * height, 1)
                path = _bars(np.round(x - half, 1), np.round(x + half, 1), heights, foot)
                parts.append(f'<path class="bar {line.colour}" d="{path}"/>')
            else:
                parts.append(f'<path class="{line.colour}" d="{_path(np.round(x, 1), heights)}"/>')
        place, label = f"translate(13 {top + height / 2}) rotate(-90)", html.escape(panel.label)
        parts.append(f'<text transform="{place}" text-anchor="middle">{label}</text>')
        return "".join(parts)

    def _x_axis(self, chart: Chart, bottom: int) -> str:
        parts = [f'<line class="axis" x1="{self.left}" x2="{self.width - _RIGHT}" y1="{bottom}" y2="{bottom}"/>']
        for tick in ticks(*self.x_range, max(3, self.width // 110)):
            if self.bar and not np.isclose(chart.x, tick).any():
                continue  # between bars there is nothing
            x = float(self._x(np.array([tick]))[0])
            parts.append(f'<text x="{x:.1f}" y="{bottom + 17}" text-anchor="middle">{tick:g}</text>')
        middle = (self.left + self.width - _RIGHT) / 2
        parts.append(f'<text x="{middle}" y="{bottom + 35}" text-anchor="middle">{html.escape(chart.x_label)}</text>')
        return "".join(parts)


def _bar_width(chart: Chart) -> float:
    """Distance of the bars of a chart that has any, in units of x; 1 of a single bar; 0 without bars."""
    if not any(panel.bars for panel in chart.panels):
        return 0.0
    return float(np.diff(chart.x).min()) if len(chart.x) > 1 else 1.0


def _label_height(panel: Panel) -> int:
    """Units that the label takes beside its panel: that of the next one begins there."""
    return math.ceil(_CHARACTER * len(panel.label))


_Axis = tuple[float, float, list[float]]
"""Least and greatest value, and the values with a number."""


def _scale(panel: Panel, height: int) -> _Axis:
    known = np.concatenate([line.values[np.isfinite(line.values)] for line in panel.lines] or [np.zeros(1)])
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    if panel.bars:
        low, high = min(low, 0.0), max(high, 0.0)
    if high - low < _ONE_VALUE * abs(high):
        low, high = low - 0.1 * abs(low), high + 0.1 * abs(high)
    margin = 0.05 * max(high - low, 1e-9)
    low, high = low - margin, high + margin
    return low, high, ticks(low, high, max(3, height // 50))


def ticks(low: float, high: float, count: int) -> list[float]:
    """About so many round numbers within a range, and at least three: a single one shows no scale."""
    rough = max(high - low, 1e-12) / count
    power = 10.0 ** math.floor(math.log10(rough))
    factors = (10, 5, 2, 1, 0.5, 0.2)
    largest = max(place for place, factor in enumerate(factors) if factor * power >= rough * 0.999)
    candidates = [_multiples(factor * power, low, high) for factor in factors[largest:]]
    return next((found for found in candidates if len(found) >= 3), candidates[0])


def _multiples(step: float, low: float, high: float) -> list[float]:
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(k * step, 10) for k in range(first, last + 1)]


def _path(x: Values, y: Values) -> str:
    """A value between two unknown ones is a line of no length, which its round ends make a dot."""
    known = np.isfinite(y)
    before, after = np.append(False, known[:-1]), np.append(known[1:], False)
    return "".join(
        f"{'L' if before[k] else 'M'}{x[k]:g} {y[k]:g}{'' if before[k] or after[k] else 'h0'}"
        for k in np.flatnonzero(known)
    )


def _bars(left: Values, right: Values, y: Values, foot: float) -> str:
    """Rectangles from the height of zero, `foot`; none for an unknown value."""
    return "".join(f"M{left[k]:g} {foot:g}V{y[k]:g}H{right[k]:g}V{foot:g}Z" for k in np.flatnonzero(np.isfinite(y)))


def _rounded(values: Values) -> list[float | None]:
    return [round(value, 3) if math.isfinite(value) else None for value in values.tolist()]
