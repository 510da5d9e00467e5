"""The thesis' Figures 8.1 to 8.18 for any set of models."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from acqd.arrays import Floats
from acqd.models.compare.evaluate import Comparison, Entry
from acqd.models.compare.kernels import difference_of_gaussian, laplacian_of_gaussian, response
from acqd.models.segments import Segment

_MOST_POINTS = 4000


def kind_label(kinds: str) -> str:
    """ "all" is the thesis' all space, not all there is."""
    return "+".join(f"{kind} space" if kind in ("all", "limited") else kind for kind in kinds.split("+"))


def heatmap(entries: list[Entry], kinds: list[str], rows: list[str]) -> Figure:
    """MAE [W] of models (rows) on test sets (columns)."""
    values = np.array([[_mae(entry, kind) for kind in kinds] for entry in entries])
    shade = np.log10(np.maximum(values, 0.1))
    low, span = float(np.nanmin(shade)), max(float(np.nanmax(shade) - np.nanmin(shade)), 0.3)
    figure = Figure(figsize=(2.2 + 1.5 * len(kinds), 1.0 + 0.42 * len(entries)))
    axes = figure.subplots()
    axes.imshow(shade, cmap="YlOrRd", aspect="auto", vmin=low, vmax=low + span)
    axes.set_xticks(range(len(kinds)), [f"test: {kind_label(kind)}" for kind in kinds])
    axes.set_yticks(range(len(entries)), rows)
    for i in range(len(entries)):
        for k in range(len(kinds)):
            if np.isfinite(values[i, k]):
                color = "white" if shade[i, k] > low + 0.65 * span else "black"
                axes.text(k, i, f"{values[i, k]:.2f}", ha="center", va="center", color=color)
    return figure


def _mae(entry: Entry, kind: str) -> float:
    return entry.metrics[kind].mae if kind in entry.metrics else float("nan")


def violins(entries: list[Entry]) -> Figure:
    """Distribution of |error| with median, MAE and RMSE; left up to the 99th percentile, right all."""
    figure = Figure(figsize=(10, 0.9 + 0.5 * len(entries)))
    near, all_of_it = figure.subplots(1, 2, sharey=True)
    random = np.random.default_rng(0)
    limit = max(float(np.percentile(entry.errors, 99)) for entry in entries)
    for k, entry in enumerate(entries):
        chosen = entry.errors
        if len(chosen) > _MOST_POINTS:
            chosen = random.choice(chosen, _MOST_POINTS, replace=False)
        for axes, shown in ((near, chosen[chosen <= limit]), (all_of_it, np.append(chosen, entry.errors.max()))):
            parts = axes.violinplot([shown], [k], orientation="horizontal", widths=0.8, showextrema=False)
            for body in parts["bodies"]:
                body.set_facecolor("#3b82c4")
                body.set_alpha(0.55)
        low, middle, high = np.percentile(entry.errors, [25, 50, 75])
        near.plot([low, high], [k, k], color="black", lw=5, solid_capstyle="butt")
        near.plot(middle, k, "o", color="white", ms=4)
        near.plot(entry.errors.mean(), k, "|", color="#b45309", ms=12, mew=2)
        near.plot(np.sqrt((entry.errors**2).mean()), k, "|", color="#7c3aed", ms=12, mew=2)
    near.set_yticks(range(len(entries)), [entry.label for entry in entries])
    near.set_xlabel("|error| [W]: median white, MAE orange, RMSE violet, quartiles black")
    near.set_xlim(0, limit)
    all_of_it.set_xlabel("|error| [W], all")
    near.invert_yaxis()
    return figure


def sample(segment: Segment, step_s: float, shown: list[tuple[str, Floats]]) -> Figure:
    """Predictions over time and against the measurement, as Figures 8.2 and 8.18."""
    figure = Figure(figsize=(11, 2.6 * len(shown)))
    panels = figure.subplots(len(shown), 2, width_ratios=(3, 1), squeeze=False)
    t = np.arange(len(segment.P)) * step_s
    for (name, guess), (time_axes, scatter) in zip(shown, panels, strict=True):
        time_axes.plot(t, segment.P, color="#52606d", lw=0.8, label="measured")
        time_axes.plot(t, guess, color="#d9480f", lw=0.8, label=name)
        time_axes.set_ylabel("P [W]")
        time_axes.legend(loc="upper right", fontsize=8, ncols=2)
        error = guess - segment.P
        scatter.plot(segment.P, guess, ".", ms=1.5, color="#3b82c4")
        ends = [float(segment.P.min()), float(segment.P.max())]
        scatter.plot(ends, ends, color="black", lw=0.7)
        r = np.corrcoef(segment.P, guess)[0, 1] if guess.std() > 0 else float("nan")
        scatter.set_title(
            f"r {r:.4f}, MAE {np.abs(error).mean():.2f} W, RMSE {np.sqrt((error**2).mean()):.2f} W", fontsize=8
        )
        scatter.set_xlabel("measured [W]", fontsize=8)
    panels[-1][0].set_xlabel("t [s]")
    figure.tight_layout()
    return figure


def kernels(weights: Floats, step_s: float, example: Floats) -> Figure:
    """Learned kernels [Q, L], their frequency responses and what they make of an angle, beside DoG and LoG."""
    count, length = weights.shape
    known = {"DoG": difference_of_gaussian(length), "LoG": laplacian_of_gaussian(length)}
    rows = {f"w{k + 1}": np.asarray(w / np.linalg.norm(w)) for k, w in enumerate(weights)} | known
    figure = Figure(figsize=(11, 1.5 * len(rows)))
    panels = figure.subplots(len(rows), 3, width_ratios=(1, 1.3, 2), squeeze=False)
    offsets = (np.arange(length) - length // 2) * step_s * 1000
    for k, ((name, kernel), (shape, spectrum, effect)) in enumerate(zip(rows.items(), panels, strict=True)):
        color = "#3b82c4" if k < count else "#52606d"
        shape.stem(offsets, kernel, basefmt=" ")
        shape.set_ylabel(name)
        f, magnitude = response(kernel, step_s)
        spectrum.plot(f, magnitude, color=color)
        effect.plot(
            np.arange(len(example) - length + 1) * step_s, np.correlate(example, kernel, "valid"), color=color, lw=0.8
        )
        for axes in (shape, spectrum, effect):
            axes.tick_params(labelsize=7)
    for axes, title in zip(
        panels[0], ("kernel, norm 1", "frequency response", "normalised angle, convolved"), strict=True
    ):
        axes.set_title(title, fontsize=9)
    for axes, label in zip(panels[-1], ("ms", "Hz", "s"), strict=True):
        axes.set_xlabel(label)
    figure.tight_layout()
    return figure


def energy(comparison: Comparison, entries: list[Entry]) -> Figure:
    """Energy error of each recording [%]."""
    names = [segment.recording for segment in comparison.test]
    recordings = sorted(set(names))
    figure = Figure(figsize=(10, 0.8 + 0.4 * len(entries)))
    axes = figure.subplots()
    for k, entry in enumerate(entries):
        off = []
        for recording in recordings:
            own = [n for n, name in enumerate(names) if name == recording]
            true = sum(float(comparison.test[n].P.sum()) for n in own)
            off.append(100 * (sum(float(entry.predicted[n].sum()) for n in own) / true - 1))
        axes.plot(off, np.full(len(off), k), "|", ms=10, color="#3b82c4")
    axes.axvspan(-1, 1, color="#d8f3dc", zorder=0)
    axes.set_yticks(range(len(entries)), [entry.label for entry in entries])
    axes.invert_yaxis()
    axes.set_xscale("symlog", linthresh=2)
    ticks = [-100, -10, -2, -1, 0, 1, 2, 10, 100]
    left, right = axes.get_xlim()
    axes.set_xticks([tick for tick in ticks if left <= tick <= right], [str(t) for t in ticks if left <= t <= right])
    axes.set_xlabel("energy predicted / measured - 1 [%], one mark a recording; green: within 1 %")
    return figure
