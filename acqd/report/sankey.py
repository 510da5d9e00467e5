"""A Sankey diagram: flows between nodes in columns, as wide as their size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NODE_WIDTH = 0.05
_GAP = 0.035
"""Between the nodes of a column, as a share of the height."""
_LEAST = 0.004
"""Share of the largest column below which a flow is not drawn."""


@dataclass(frozen=True, slots=True)
class Node:
    """A bar in a column."""

    name: str
    column: int
    colour: str = "#9aa5b1"


@dataclass(frozen=True, slots=True)
class Flow:
    """A band from one node to another, by their numbers."""

    source: int
    target: int
    size: float
    """At least 0."""


def sankey(nodes: Sequence[Node], flows: Sequence[Flow], label: str) -> Figure:
    """Draw the diagram; `label` is a format with `{name}` and `{size}` for nodes, such as "{name} {size:.2f} Wh"."""
    from matplotlib.figure import Figure

    sizes = [max(_sum(flows, k, "source"), _sum(flows, k, "target")) for k in range(len(nodes))]
    columns = sorted({node.column for node in nodes})
    whole = max(sum(size for node, size in zip(nodes, sizes, strict=True) if node.column == c) for c in columns)
    flows = [flow for flow in flows if flow.size >= _LEAST * whole]
    drawn = {k for flow in flows for k in (flow.source, flow.target)}
    figure = Figure(figsize=(10.0, 5.4), layout="constrained")
    axes = figure.subplots()
    axes.axis("off")
    tops: dict[int, float] = {}
    for column in columns:
        here = [k for k in range(len(nodes)) if nodes[k].column == column and k in drawn]
        top = (1.0 + _GAP * 4) / 2 + (sum(sizes[k] for k in here) / whole + _GAP * (len(here) - 1)) / 2
        for k in here:
            tops[k] = top
            top -= sizes[k] / whole + _GAP
    for k in sorted(tops):
        height = sizes[k] / whole
        x = float(nodes[k].column)
        axes.fill([x, x + _NODE_WIDTH, x + _NODE_WIDTH, x], [tops[k], tops[k], tops[k] - height, tops[k] - height],
                  color=nodes[k].colour, lw=0)  # fmt: skip
        axes.text(x + _NODE_WIDTH + 0.02, tops[k] - height / 2, label.format(name=nodes[k].name, size=sizes[k]),
                  va="center", fontsize=8)  # fmt: skip
    leaving, arriving = dict(tops), dict(tops)
    for flow in sorted(flows, key=lambda each: (-tops[each.source], -tops[each.target])):
        height = flow.size / whole
        colour = nodes[flow.target if nodes[flow.target].colour != "#9aa5b1" else flow.source].colour
        _band(axes, (nodes[flow.source].column + _NODE_WIDTH, leaving[flow.source]),
              (nodes[flow.target].column, arriving[flow.target]), height, colour)  # fmt: skip
        leaving[flow.source] -= height
        arriving[flow.target] -= height
    axes.set_xlim(columns[0] - 0.02, columns[-1] + 0.75)
    return figure


def _sum(flows: Sequence[Flow], node: int, end: str) -> float:
    return sum(flow.size for flow in flows if getattr(flow, end) == node)


def _band(axes: Axes, begin: tuple[float, float], end: tuple[float, float], height: float, colour: str) -> None:
    """A band whose edges are cubic Bezier curves, horizontal at both ends."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    (x0, y0), (x1, y1) = begin, end
    middle = (x0 + x1) / 2
    corners = [(x0, y0), (middle, y0), (middle, y1), (x1, y1), (x1, y1 - height), (middle, y1 - height),
               (middle, y0 - height), (x0, y0 - height), (x0, y0)]  # fmt: skip
    codes = [Path.MOVETO, *[Path.CURVE4] * 3, Path.LINETO, *[Path.CURVE4] * 3, Path.CLOSEPOLY]
    axes.add_patch(PathPatch(Path(corners, codes), facecolor=colour, alpha=0.35, lw=0))
