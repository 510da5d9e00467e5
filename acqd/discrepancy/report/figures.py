"""Figures of the closing report: error of every recording, joints, explained power, residual along quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.joints.summary import JointLevel
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.strength import Strength
from acqd.models.metrics import predictions
from acqd.residual.aspects import Aspect, aspects

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_BEFORE, _AFTER, _UNNAMED = "#b45309", "#1d6fa5", "#9aa5b1"
_MOST_POINTS = 3000


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def by_recording(closed: Closed) -> Figure:
    """RMS residual of the held-out segments in the order of time."""
    held_out = closed.subject.held_out
    order = np.argsort([segment.start_s for segment in held_out])
    figure = _figure(9.5, 2.8)
    axes = figure.subplots()
    x = np.arange(len(order))
    bars = [(closed.errors_before, _BEFORE, "before" if closed.extended else "model")]
    if closed.extended:
        bars.append((closed.errors_after, _AFTER, "after"))
    for number, (errors, colour, label) in enumerate(bars):
        heights = [float(np.sqrt((errors[k] ** 2).mean())) for k in order]
        axes.bar(x + 0.4 * (number - (len(bars) - 1) / 2), heights, 0.4, color=colour, label=label)
    if closed.reference_rmse is not None:
        axes.axhline(closed.reference_rmse, color="black", lw=1, ls="--", label="when the model was made")
    axes.set_xticks(x, [held_out[k].recording for k in order], rotation=60, ha="right", fontsize=7)
    axes.set_ylabel("residual, RMS [W]")
    axes.set_xlabel("held-out recording")
    figure.legend(frameon=False, ncols=3, loc="outside upper left")
    return figure


def joints(level: JointLevel) -> Figure:
    """Logged torque against the torque of the reference's model, one panel per joint."""
    count = len(level.logged)
    columns = min(count, 4)
    figure = _figure(9.5, 2.4 * -(-count // columns))
    panels = np.atleast_1d(figure.subplots(-(-count // columns), columns)).ravel()
    for number, (axes, logged, modelled) in enumerate(zip(panels, level.logged, level.modelled, strict=False)):
        every = max(1, len(logged) // _MOST_POINTS)
        axes.plot(modelled[::every], logged[::every], ".", ms=1.5, color=_AFTER, rasterized=True)
        if len(logged):
            ends = [float(min(logged.min(), modelled.min())), float(max(logged.max(), modelled.max()))]
            axes.plot(ends, ends, color="black", lw=0.7)
        axes.set_title(
            f"joint {number + 1}: {level.rms[number]:.2g} Nm ({level.rms_reference[number]:.2g})", fontsize=8
        )
        axes.tick_params(labelsize=7)
    for axes in panels[count:]:
        axes.set_axis_off()
    figure.supxlabel("torque of the reference's model [Nm]", fontsize=8)
    figure.supylabel("logged torque [Nm]", fontsize=8)
    return figure


def explained(strength: Strength, name: str) -> Figure:
    """Left: residual without the effect against the power of the effect, in bins. Right: block by block."""
    x, y, share = strength.power, strength.left, strength.shares
    figure = _figure(9.5, 3.4)
    left, right = figure.subplots(1, 2, width_ratios=[1, 1])
    middle, mean, error = _bins(x, y)
    left.errorbar(middle, mean, 2 * error, fmt="o", ms=4, color=_AFTER, label="mean of bins")
    limits = np.array([x.min(), x.max()])
    left.plot(limits, limits, color="black", lw=0.8, label="line of equality")
    left.set_xlabel(f"power of {name} as fitted [W]")
    left.set_ylabel("residual without the effect [W]")
    left.legend(frameon=False, fontsize=8)
    right.axhline(1, color="black", lw=0.8)
    right.axhline(0, color=_UNNAMED, lw=0.8)
    right.plot(share, "o", ms=4, color=_AFTER)
    right.set_ylim(*np.clip([min(np.min(share), -0.2), max(np.max(share), 1.4)], -3, 5))
    right.set_xlabel("blocks of at most a minute, in the order of time")
    right.set_ylabel("strength relative to the fit")
    return figure


def _bins(x: Floats, y: Floats, count: int = 15) -> tuple[Floats, Floats, Floats]:
    edges = np.unique(np.quantile(x, np.linspace(0, 1, count + 1)))
    if len(edges) < 2:
        return np.array([x.mean()]), np.array([y.mean()]), np.array([y.std() / np.sqrt(len(y))])
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    size = np.maximum(np.bincount(which, minlength=len(edges) - 1), 1)
    mean = np.bincount(which, y, len(edges) - 1) / size
    spread = np.sqrt(np.maximum(np.bincount(which, y**2, len(edges) - 1) / size - mean**2, 0))
    return np.bincount(which, x, len(edges) - 1) / size, mean, spread / np.sqrt(size)


def law(correction: Correction) -> Figure:
    """A law without a name over the quantity that it depends on most."""
    figure = _figure(9.5, 3.0)
    axes = figure.subplots()
    every = max(1, len(correction.strength) // _MOST_POINTS)
    axes.plot(correction.along.values[::every], correction.strength[::every], ".", ms=2, color=_AFTER, rasterized=True)
    axes.axhline(0, color="black", lw=0.5)
    axes.set_xlabel(f"{correction.along.name} [{correction.along.unit}]")
    axes.set_ylabel(
        f"{'power' if correction.unit == 'W' else 'torque' if correction.unit == 'Nm' else 'force'} [{correction.unit}]"
    )
    return figure


def along(closed: Closed) -> Figure:
    """The residual along recorded quantities, before and after."""
    held_out, step_s = closed.subject.held_out, closed.subject.data.step_s
    predicted = predictions(closed.subject.model, held_out)
    before = aspects(held_out, closed.errors_before, predicted, step_s)
    after = aspects(held_out, closed.errors_after, predicted, step_s)
    columns = 4
    rows = -(-len(before) // columns)
    figure = _figure(11, 1.9 * rows)
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for axes, one, other in zip(panels, before, after, strict=False):
        _along(axes, one, _BEFORE)
        if closed.extended:
            _along(axes, other, _AFTER)
        axes.axhline(0, color="black", lw=0.5)
        axes.set_title(f"{one.name} [{one.unit}]", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.locator_params(axis="x", nbins=4)  # "229.25" is a long word
    for axes in panels[len(before) :]:
        axes.set_visible(False)
    figure.supylabel("residual [W]", fontsize=8)
    if closed.extended:
        figure.legend(*_legend(), frameon=False, ncols=2, loc="outside upper left", fontsize=8)
    return figure


def _legend() -> tuple[list[Line2D], list[str]]:
    from matplotlib.lines import Line2D

    return [Line2D([], [], color=colour, lw=1.2) for colour in (_BEFORE, _AFTER)], ["before", "after"]


def _along(axes: object, aspect: Aspect, colour: str) -> None:
    axes.fill_between(aspect.middle, aspect.mean - aspect.rms, aspect.mean + aspect.rms, color=colour, alpha=0.15)  # type: ignore[attr-defined]
    axes.plot(aspect.middle, aspect.mean, color=colour, lw=1.2)  # type: ignore[attr-defined]
