"""Pictures of a balance: where the energy goes, and the power by cause over a minute."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from acqd.arrays import Floats
from acqd.balance.balance import Span
from acqd.balance.rows import Rows
from acqd.models.effects.cause import Cause
from acqd.report.palette import CAUSES
from acqd.report.sankey import Flow, Node, sankey

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {cause: CAUSES[cause.value] for cause in Cause}
_BACK, _MAINS, _PLAIN = "#2a9d8f", "#1d6fa5", "#9aa5b1"
_CURVE_S, _CURVE_STEP_S = 60.0, 0.2


class _Diagram:
    """Nodes by name, and flows."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.flows: list[Flow] = []
        self._number: dict[tuple[str, int], int] = {}

    def flow(self, source: tuple[str, int, str], target: tuple[str, int, str], size: float) -> None:
        """From one node (name, column, colour) to another; nothing where the size is not positive."""
        if size > 0:
            self.flows.append(Flow(self._node(*source), self._node(*target), size))

    def _node(self, name: str, column: int, colour: str) -> int:
        key = (name, column)
        if key not in self._number:
            self._number[key] = len(self.nodes)
            self.nodes.append(Node(name, column, colour))
        return self._number[key]


def flows_of(span: Span, axes: int) -> tuple[list[Node], list[Flow]]:
    """Nodes and flows in kWh: sources, supply, consumers, losses of the drives, joints.

    As much enters the supply and the drives as leaves them. A cause that is negative in sum is a source.
    """
    diagram = _Diagram()
    supply, drives = ("supply", 1, _PLAIN), ("drives", 2, _PLAIN)
    returned = float(span.returned.joints.sum())
    gross = returned + sum(float(each.joints[:axes].sum()) for each in span.entries)
    diagram.flow(("mains", 0, _MAINS), supply, span.predicted + span.returned.to_mains)
    diagram.flow(("given back", 0, _BACK), supply, returned)
    for cause in span.by_cause():
        mine = [each.joints for each in span.entries if each.cause == cause]
        beside, joints = sum(float(each[axes]) for each in mine), np.sum([each[:axes] for each in mine], axis=0)
        node = (cause.value, 2, COLOURS[cause])
        diagram.flow(supply, node, beside)
        diagram.flow((f"{cause.value}, less", 0, COLOURS[cause]), supply, -beside)
        at_drives = (cause.value, 3, COLOURS[cause])
        diagram.flow(drives, at_drives, float(joints.sum()))
        diagram.flow((f"{cause.value}, less", 1, COLOURS[cause]), drives, -float(joints.sum()))
        if not cause.stored and (joints >= 0).all():
            for number, size in enumerate(joints.tolist(), start=1):
                diagram.flow(at_drives, (f"joint {number}", 4, _PLAIN), size)
    diagram.flow(supply, drives, gross)
    diagram.flow(supply, ("fed to the mains", 2, _MAINS), span.returned.to_mains)
    diagram.flow(drives, ("given back", 3, _BACK), returned)
    return diagram.nodes, diagram.flows


def energy_flows(span: Span, axes: int) -> Figure:
    """The Sankey diagram of a span, in Wh."""
    nodes, flows = flows_of(span, axes)
    watt_hours = [Flow(each.source, each.target, 1000 * each.size) for each in flows]
    return sankey(nodes, watt_hours, "{name}: {size:.3g} Wh")


def power_by_cause(rows: Rows) -> tuple[Figure, str]:
    """Power by cause over the minute with the largest mean power, stacked, and the name of its recording."""
    from matplotlib.figure import Figure

    chosen = _busiest(rows)
    every = max(1, round(_CURVE_STEP_S / rows.step_s))
    chosen = chosen[: len(chosen) // every * every]
    t = (rows.time[chosen] - rows.time[chosen[0]]).reshape(-1, every).mean(axis=1)
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    axes = figure.subplots()
    above, below = np.zeros(len(t)), np.zeros(len(t))
    for cause in Cause:
        mine = [each.power[chosen] for each in rows.parts if each.cause == cause]
        power = _means(np.sum(mine, axis=0), every) if mine else np.zeros(len(t))
        if not np.abs(power).max() > 0:
            continue
        axes.fill_between(t, above, above + np.maximum(power, 0), color=COLOURS[cause], lw=0, label=cause.value)
        axes.fill_between(t, below, below + np.minimum(power, 0), color=COLOURS[cause], lw=0)
        above, below = above + np.maximum(power, 0), below + np.minimum(power, 0)
    axes.plot(t, _means(rows.predicted[chosen], every), color="#000000", lw=1.0, label="predicted")
    axes.plot(t, _means(rows.P[chosen], every), color="#000000", lw=1.0, ls=":", label="measured")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("power at the mains [W]")
    axes.legend(fontsize=7, ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    return figure, str(rows.recording[chosen[0]])


def _means(values: Floats, every: int) -> Floats:
    return np.asarray(values.reshape(-1, every).mean(axis=1))


def _busiest(rows: Rows) -> np.ndarray:
    """Consecutive rows of one recording, a minute at most, with the largest mean power."""
    breaks = np.flatnonzero((rows.recording[1:] != rows.recording[:-1]) | (np.diff(rows.time) > 1.5 * rows.step_s))
    edges = [0, *(breaks + 1).tolist(), len(rows.P)]
    most = round(_CURVE_S / rows.step_s)
    best: tuple[float, int, int] = (-np.inf, 0, 1)
    for first, last in pairwise(edges):
        width = min(most, last - first)
        sums = np.concatenate([[0.0], np.cumsum(rows.P[first:last])])
        means = (sums[width:] - sums[:-width]) / width
        place = int(np.argmax(means))
        best = max(best, (float(means[place]) * min(1.0, width / most), first + place, first + place + width))
    return np.arange(best[1], best[2])
