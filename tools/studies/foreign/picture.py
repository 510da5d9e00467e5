"""The reliability diagram: share of right names over said confidence."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tools.studies.foreign.generator.arm import Floats

_COLOUR, _GREY = "#1d6fa5", "#9ca3af"
_DOTS_PER_INCH = 150


def draw(rows: list[dict[str, float]], path: Path) -> None:
    """Draw the bins of `tables.reliability` with 95 % intervals (Wilson's score)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 5), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color=_GREY, linewidth=1, label="calibrated")
    said, right, names = (np.array([row[key] for row in rows]) for key in ("said", "right", "names"))
    low, high = wilson(right, names)
    axes.errorbar(
        said, right, np.maximum([right - low, high - right], 0.0), fmt="o", color=_COLOUR, capsize=3,
        label="names given (simulated, foreign plants)",
    )  # fmt: skip
    for x, y, count in zip(said, right, names, strict=True):
        axes.annotate(f"{count:.0f}", (x, y), xytext=(6, -12), textcoords="offset points", color=_COLOUR)
    axes.set(xlim=(0, 1.02), ylim=(0, 1.02), xlabel="said confidence", ylabel="share of right names", aspect="equal")
    axes.legend(loc="upper left", frameon=False)
    figure.savefig(path, dpi=_DOTS_PER_INCH)


def wilson(share: Floats, count: Floats) -> tuple[Floats, Floats]:
    """95 % interval of a share of `count` trials (Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    z2 = 1.96**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = 1.96 / (1 + z2 / count) * np.sqrt(share * (1 - share) / count + z2 / (4 * count**2))
    return middle - half, middle + half
