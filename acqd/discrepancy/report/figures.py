"""Figures of the closing report: error over time, ranking of hypotheses, explained power, residual along quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.joints.summary import JointLevel
from acqd.discrepancy.loop import Closed
from acqd.discrepancy.residual.aspects import Aspect, aspects
from acqd.discrepancy.residual.whitening import autocorrelation
from acqd.discrepancy.selection.accepted import Named
from acqd.discrepancy.selection.ranking import Finding
from acqd.models.metrics import predictions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BEFORE, _AFTER, _UNNAMED = "#b45309", "#1d6fa5", "#9aa5b1"
_SHOWN_S = 40.0
_MOST_POINTS = 3000


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def example(closed: Closed) -> Figure:
    """Measured power, and predicted power before and after, where the loop helped most."""
    held_out, step_s = closed.subject.held_out, closed.subject.data.step_s
    gains = [
        float((b**2).mean() - (a**2).mean()) for b, a in zip(closed.errors_before, closed.errors_after, strict=True)
    ]
    k = int(np.argmax(gains))
    segment = held_out[k]
    before, after = segment.P - closed.errors_before[k], segment.P - closed.errors_after[k]
    width = min(len(before), int(_SHOWN_S / step_s))
    better = np.convolve(closed.errors_before[k] ** 2 - closed.errors_after[k] ** 2, np.ones(width), "valid")
    first = int(better.argmax())
    rows = slice(first, first + width)
    t = step_s * np.arange(len(before))[rows]
    figure = _figure(9.5, 5.2)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    top.plot(t, segment.P[rows], color="black", lw=1.0, label="measured")
    top.plot(t, before[rows], color=_BEFORE, lw=1.0, label="model before")
    top.plot(t, after[rows], color=_AFTER, lw=1.0, label="model after")
    top.set_ylabel("P [W]")
    top.legend(ncols=3, frameon=False)
    bottom.plot(t, closed.errors_before[k][rows], color=_BEFORE, lw=0.8)
    bottom.plot(t, closed.errors_after[k][rows], color=_AFTER, lw=0.8)
    bottom.axhline(0, color="black", lw=0.5)
    bottom.set_ylabel("residual [W]")
    bottom.set_xlabel(f"time in {segment.recording} [s]")
    return figure


def by_recording(closed: Closed) -> Figure:
    """RMS residual of the held-out recordings in the order of time."""
    held_out = closed.subject.held_out
    order = np.argsort([segment.start_s for segment in held_out])
    figure = _figure(9.5, 2.8)
    axes = figure.subplots()
    x = np.arange(len(order))
    for errors, colour, label, shift in (
        (closed.errors_before, _BEFORE, "before", -0.2),
        (closed.errors_after, _AFTER, "after", 0.2),
    ):
        heights = [float(np.sqrt((errors[k] ** 2).mean())) for k in order]
        axes.bar(x + shift, heights, 0.4, color=colour, label=label)
    if closed.reference_rmse is not None:
        axes.axhline(closed.reference_rmse, color="black", lw=1, ls="--", label="when the model was made")
    axes.set_xticks(x, [held_out[k].recording for k in order], rotation=60, ha="right", fontsize=7)
    axes.set_ylabel("residual, RMS [W]")
    axes.legend(frameon=False, ncols=3)
    return figure


def joints(level: JointLevel) -> Figure:
    """Logged torque against the torque of the reference's model, one panel per joint."""
    count = len(level.logged)
    columns = min(count, 4)
    figure = _figure(9.5, 2.4 * -(-count // columns))
    panels = np.atleast_1d(figure.subplots(-(-count // columns), columns)).ravel()
    for number, (axes, logged, modelled) in enumerate(zip(panels, level.logged, level.modelled, strict=False)):
        every = max(1, len(logged) // _MOST_POINTS)
        axes.plot(modelled[::every], logged[::every], ".", ms=1.5, color=_AFTER)
        if len(logged):
            ends = [float(min(logged.min(), modelled.min())), float(max(logged.max(), modelled.max()))]
            axes.plot(ends, ends, color="black", lw=0.7)
        axes.set_title(
            f"joint {number + 1}: {level.rms[number]:.2g} Nm ({level.rms_reference[number]:.2g})", fontsize=8
        )
        axes.tick_params(labelsize=7)
    for axes in panels[count:]:
        axes.set_axis_off()
    figure.supxlabel("model of the reference [Nm]", fontsize=8)
    figure.supylabel("logged [Nm]", fontsize=8)
    return figure


def ranking(findings: list[Finding], chosen: str | None) -> Figure:
    """Evidence for every hypothesis: one bar per effect or unnamed alternative."""
    best: dict[str, Finding] = {}
    for finding in findings:
        name = finding.candidate.id or f"unnamed: {finding.candidate.label}"
        best.setdefault(name, finding)
    shown = [(name, finding) for name, finding in best.items() if finding.evidence > 0][:12][::-1]
    figure = _figure(9.5, 0.6 + 0.3 * max(len(shown), 1))
    axes = figure.subplots()
    colours = [_AFTER if name == chosen else (_UNNAMED if name.startswith("unnamed") else _BEFORE) for name, _ in shown]
    axes.barh(range(len(shown)), [finding.evidence for _, finding in shown], color=colours)
    axes.set_yticks(
        range(len(shown)), [f"{n} ({f.candidate.label})" if f.candidate.id else n for n, f in shown], fontsize=8
    )
    axes.set_xscale("symlog", linthresh=10)
    axes.set_xlabel("evidence: white squared error explained beyond chance")
    return figure


def explained(closed: Closed, named: Named) -> Figure:
    """Left: residual without the effect against the power of the effect, in bins. Right: block by block."""
    tracing = closed.tracing
    design, regression = tracing.design, tracing.regression
    beta = regression.solve()
    mine = np.array([column.owner == named.key for column in regression.columns])
    contribution, partial, share, starts = [], [], [], []
    for number, part in enumerate(design.parts):
        if not named.gate.open[number]:
            continue
        values = design.values(part.segment, regression.places, part.rows)
        weights = beta * regression.gates[:, number]
        effect = values @ np.where(mine, weights, 0.0)
        rest = design.columns.residual[part.segment][part.rows] - values @ np.where(mine, 0.0, weights)
        contribution.append(effect)
        partial.append(rest)
        power = float(effect @ effect)
        if power > 0:
            share.append(float(effect @ rest) / power)
            starts.append(part.start_s)
    x: Floats = np.concatenate(contribution).astype(np.float64)
    y: Floats = np.concatenate(partial).astype(np.float64)
    figure = _figure(9.5, 3.4)
    left, right = figure.subplots(1, 2, width_ratios=[1, 1])
    middle, mean, error = _bins(x, y)
    left.errorbar(middle, mean, 2 * error, fmt="o", ms=4, color=_AFTER, label="mean of bins")
    limits = np.array([x.min(), x.max()])
    left.plot(limits, limits, color="black", lw=0.8, label="line of equality")
    left.set_xlabel(f"power of {named.id} as fitted [W]")
    left.set_ylabel("residual without the effect [W]")
    left.legend(frameon=False, fontsize=8)
    order = np.argsort(starts)
    right.axhline(1, color="black", lw=0.8)
    right.axhline(0, color=_UNNAMED, lw=0.8)
    right.plot(np.array(share)[order], "o", ms=4, color=_AFTER)
    right.set_ylim(*np.clip([min(np.min(share), -0.2), max(np.max(share), 1.4)], -3, 5))
    right.set_xlabel("blocks of a minute, in time")
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
        _along(axes, other, _AFTER)
        axes.axhline(0, color="black", lw=0.5)
        axes.set_title(f"{one.name} [{one.unit}]", fontsize=8)
        axes.tick_params(labelsize=7)
    for axes in panels[len(before) :]:
        axes.set_visible(False)
    return figure


def _along(axes: object, aspect: Aspect, colour: str) -> None:
    axes.fill_between(aspect.middle, aspect.mean - aspect.rms, aspect.mean + aspect.rms, color=colour, alpha=0.15)  # type: ignore[attr-defined]
    axes.plot(aspect.middle, aspect.mean, color=colour, lw=1.2)  # type: ignore[attr-defined]


def correlation(closed: Closed) -> Figure:
    """Autocorrelation of the residual."""
    lags = 50
    figure = _figure(9.5, 2.5)
    axes = figure.subplots()
    t = closed.subject.data.step_s * np.arange(1, lags + 1)
    axes.plot(t, autocorrelation(closed.errors_before, lags), color=_BEFORE, label="before")
    axes.plot(t, autocorrelation(closed.errors_after, lags), color=_AFTER, label="after")
    axes.axhline(0, color="black", lw=0.5)
    axes.set_xlabel("lag [s]")
    axes.set_ylabel("autocorrelation")
    axes.legend(frameon=False)
    return figure
