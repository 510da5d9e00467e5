"""Memory over time."""

from __future__ import annotations

from pathlib import Path

from tools.studies.soak.usage import Sampler

_DOTS_PER_INCH = 150


def draw(sampler: Sampler, path: Path) -> None:
    """Resident memory of every service; the format follows the file's name."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 4), layout="constrained")
    axes = figure.add_subplot()
    for name in dict.fromkeys(sample.name for sample in sampler.samples):
        samples = sampler.of(name)
        axes.plot([s.at_s / 60 for s in samples], [s.usage.rss / 1e6 for s in samples], label=name)
    axes.set(xlabel="min", ylabel="resident memory [MB]", ylim=(0, None), title="simulated source")
    axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1, 0.5))
    figure.savefig(path, dpi=_DOTS_PER_INCH)
