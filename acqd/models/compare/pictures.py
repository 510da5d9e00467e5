"""Figures of the comparison report, as in thesis chapter 8."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from acqd.arrays import Floats
from acqd.models.compare.evaluate import Comparison, Entry
from acqd.models.compare.kernels import difference_of_gaussian, laplacian_of_gaussian, response
from acqd.models.segments import Segment

_MAX_POINTS = 4000


def kind_label(kinds: str) -> str:
    """Kinds of trajectories for people: "all" is the thesis' all space, not all data."""
    return "+".join(f"{kind} space" if kind in ("all", "limited") else kind for kind in kinds.split("+"))


def heatmap(entries: list[Entry], kinds: list[str], rows: list[str]) -> Figure:
    """MAE [W] of models (rows) on kinds of held-out recordings (columns)."""
    kinds = [kind for kind in kinds if any(kind in entry.metrics for entry in entries)]
    values = np.array([[_mae(entry, kind) for kind in kinds] for entry in entries])
    shade = np.log10(np.maximum(values, 0.1))
    low, span = float(np.nanmin(shade)), max(float(np.nanmax(shade) - np.nanmin(shade)), 0.3)
    figure = Figure(figsize=(2.2 + 1.5 * len(kinds), 1.0 + 0.42 * len(entries)))
    axes = figure.subplots()
    axes.imshow(shade, cmap="YlOrRd", aspect="auto", vmin=low, vmax=low + span)
    axes.set_xticks(range(len(kinds)), [kind_label(kind) for kind in kinds])
    axes.set_yticks(range(len(entries)), rows)
    axes.set_xlabel("held-out recordings; in the cells: MAE [W]")
    axes.set_ylabel("model")
    for i in range(len(entries)):
        for k in range(len(kinds)):
            if np.isfinite(values[i, k]):
                color = "#fffffe" if shade[i, k] > low + 0.65 * span else "#000001"  # not of the theme
                axes.text(k, i, f"{values[i, k]:.2f}", ha="center", va="center", color=color)
    return figure


def _mae(entry: Entry, kind: str) -> float:
    return entry.metrics[kind].mae if kind in entry.metrics else float("nan")


def violins(entries: list[Entry]) -> Figure:
    """Distribution of absolute errors; left up to the largest 99th percentile, right all.

    A thick line joins the quartiles, a dot is the median; the legend names the marks of MAE and RMSE.
    """
    figure = Figure(figsize=(10, 0.9 + 0.5 * len(entries)))
    near, full = figure.subplots(1, 2, sharey=True)
    random = np.random.default_rng(0)
    limit = max(float(np.percentile(entry.errors, 99)) for entry in entries)
    for k, entry in enumerate(entries):
        chosen = entry.errors
        if len(chosen) > _MAX_POINTS:
            chosen = random.choice(chosen, _MAX_POINTS, replace=False)
        for axes, shown in ((near, chosen[chosen <= limit]), (full, np.append(chosen, entry.errors.max()))):
            parts = axes.violinplot([shown], [k], orientation="horizontal", widths=0.8, showextrema=False)
            for body in parts["bodies"]:
                body.set_facecolor("#3b82c4")
                body.set_alpha(0.55)
        low, middle, high = np.percentile(entry.errors, [25, 50, 75])
        near.plot([low, high], [k, k], color="black", lw=5, solid_capstyle="butt")
        near.plot(middle, k, "o", color="white", ms=4)
        near.plot(entry.errors.mean(), k, "|", color="#b45309", ms=12, mew=2, label=None if k else "MAE")
        near.plot(np.sqrt((entry.errors**2).mean()), k, "x", color="#7c3aed", ms=7, mew=2, label=None if k else "RMSE")
    near.set_yticks(range(len(entries)), [entry.name for entry in entries])
    near.set_ylabel("model")
    near.set_xlabel("absolute error [W], lower part")
    near.set_xlim(0, limit)
    near.legend(frameon=False, fontsize=8, loc="lower right")
    full.set_xlabel("absolute error [W]")
    near.invert_yaxis()
    return figure


def sample(segment: Segment, step_s: float, shown: list[tuple[str, Floats]]) -> Figure:
    """Predicted power over time, and against the measured power, one row per model."""
    figure = Figure(figsize=(11, 2.6 * len(shown)))
    panels = figure.subplots(len(shown), 2, width_ratios=(3, 1), squeeze=False)
    t = np.arange(len(segment.P)) * step_s
    for (name, predicted), (time_axes, scatter) in zip(shown, panels, strict=True):
        time_axes.plot(t, segment.P, color="#52606d", lw=0.8, label="measured")
        time_axes.plot(t, predicted, color="#d9480f", lw=0.8, label=name)
        time_axes.set_ylabel("power [W]")
        time_axes.legend(loc="upper right", fontsize=8, ncols=2)
        error = predicted - segment.P
        scatter.plot(segment.P, predicted, ".", ms=1.5, color="#3b82c4", rasterized=True)
        ends = [float(segment.P.min()), float(segment.P.max())]
        scatter.plot(ends, ends, color="black", lw=0.7)
        r = np.corrcoef(segment.P, predicted)[0, 1] if predicted.std() > 0 else float("nan")
        scatter.set_title(
            f"r = {r:.2f}, MAE {np.abs(error).mean():.2f} W, RMSE {np.sqrt((error**2).mean()):.2f} W", fontsize=8
        )
        scatter.set_xlabel("measured power [W]", fontsize=8)
        scatter.set_ylabel("predicted power [W]", fontsize=8)
    panels[-1][0].set_xlabel("time [s]")
    figure.tight_layout()
    return figure


def kernels(weights: Floats, step_s: float, example: Floats) -> Figure:
    """Learned kernels [Q, L], DoG and LoG: weights, frequency response, and an example angle convolved with them."""
    count, length = weights.shape
    known = {"DoG": difference_of_gaussian(length), "LoG": laplacian_of_gaussian(length)}
    rows = {f"w{k + 1}": np.asarray(w / np.linalg.norm(w)) for k, w in enumerate(weights)} | known
    figure = Figure(figsize=(11, 1.5 * len(rows)))
    panels = figure.subplots(len(rows), 3, width_ratios=(1, 1.3, 2), squeeze=False)
    offsets = (np.arange(length) - length // 2) * step_s * 1000
    for k, ((name, kernel), (shape, spectrum, effect)) in enumerate(zip(rows.items(), panels, strict=True)):
        color = "#3b82c4" if k < count else "#52606d"
        shape.stem(offsets, kernel, basefmt=" ")
        shape.set_ylabel(f"{name} [1]")
        f, magnitude = response(kernel, step_s)
        spectrum.plot(f, magnitude, color=color)
        effect.plot(
            np.arange(len(example) - length + 1) * step_s, np.correlate(example, kernel, "valid"), color=color, lw=0.8
        )
        for axes in (shape, spectrum, effect):
            axes.tick_params(labelsize=7)
    for axes, title in zip(
        panels[0],
        ("weight [1], norm 1", "magnitude of the response [1]", "normalised angle, convolved [1]"),
        strict=True,
    ):
        axes.set_title(title, fontsize=9)
    for axes, label in zip(panels[-1], ("time [ms]", "frequency [Hz]", "time [s]"), strict=True):
        axes.set_xlabel(label)
    figure.tight_layout()
    return figure


def energy(comparison: Comparison, entries: list[Entry]) -> Figure:
    """Relative energy error [%] of each recording, one mark per recording."""
    names = [segment.recording for segment in comparison.test]
    recordings = sorted(set(names))
    figure = Figure(figsize=(10, 0.8 + 0.4 * len(entries)))
    axes = figure.subplots()
    for k, entry in enumerate(entries):
        errors = []
        for recording in recordings:
            segments = [n for n, name in enumerate(names) if name == recording]
            true = sum(float(comparison.test[n].P.sum()) for n in segments)
            errors.append(100 * (sum(float(entry.predicted[n].sum()) for n in segments) / true - 1))
        axes.plot(errors, np.full(len(errors), k), "|", ms=10, color="#3b82c4")
    axes.axvspan(-1, 1, color="#d8f3dc", zorder=0)
    axes.set_yticks(range(len(entries)), [entry.name for entry in entries])
    axes.set_ylabel("model")
    axes.invert_yaxis()
    axes.set_xscale("symlog", linthresh=2)
    ticks = [-100, -10, -2, -1, 0, 1, 2, 10, 100]
    left, right = axes.get_xlim()
    axes.set_xticks([tick for tick in ticks if left <= tick <= right], [str(t) for t in ticks if left <= t <= right])
    axes.set_xlabel("relative error of the energy [%]")
    return figure
