"""The report of `acqd lab campaign`, which contains nothing of the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from acqd.arrays import Floats
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.digits import duration
from acqd.report.lines import Chart, Line, Panel

_COLOURS = ("#2563eb", "#d97706", "#059669", "#7c3aed")


def campaign_report(
    title: str, powers: dict[str, Floats], spaces: dict[str, dict[str, float]], window_s: float, folder: Path
) -> Path:
    """Distribution of metered power per space, and one recording per space."""
    robot = title.partition(",")[0]
    page = Page(f"Virtual measurement campaign: {title}", simulated=True, kind="campaign", subject=robot)
    page.verdict(_verdict(spaces))
    by_space = {
        space: {name: P for name, P in powers.items() if name.split("/")[-1].startswith(space)} for space in spaces
    }
    figure = _distribution(by_space)
    page.figure(figure, "Distribution of the metered power of all recordings.", folder / "power_distribution.png")
    page.heading("Spaces")
    header = ["space", "recordings", "recorded", "mean P [W]", "99th percentile [W]", "maximum [W]"]
    page.table(header, [_row(name, figures) for name, figures in spaces.items()])
    for space, recordings in by_space.items():
        page.heading(f"A recording in {space} space")
        name, P = next(iter(recordings.items()))
        alt = f"Metered power of {name}, mean {np.nanmean(P):.0f} W, at most {np.nanmax(P):.0f} W"
        chart = Chart(
            np.arange(len(P)) * window_s, "time since the first window [s]", [Panel("P [W]", [Line(name, P)])], alt
        )
        page.lines(chart, f"Metered active power of {name}.")
    page.detail("command", "not shown: it would tell what is hidden")
    path = folder / "report.html"
    page.write(path)
    return path


def _verdict(spaces: dict[str, dict[str, float]]) -> Verdict:
    recordings = sum(int(figures["recordings"]) for figures in spaces.values())
    hours = sum(figures["hours"] for figures in spaces.values())
    mean = sum(figures["mean_W"] * figures["hours"] for figures in spaces.values()) / max(hours, 1e-12)
    figures = [
        KeyFigure("recorded", duration(3600 * hours), f"{recordings} recordings"),
        KeyFigure("mean power", f"{mean:.1f} W"),
        KeyFigure("largest power", f"{max(each['max_W'] for each in spaces.values()):.0f} W"),
    ]
    return Verdict("fine", f"{recordings} recordings were measured", "", figures)


def _row(name: str, figures: dict[str, float]) -> list[object]:
    powers = (f"{figures[key]:.1f}" for key in ("mean_W", "p99_W", "max_W"))
    return [name, int(figures["recordings"]), duration(3600 * figures["hours"]), *powers]


def _distribution(by_space: dict[str, dict[str, Floats]]) -> Figure:
    figure = Figure(figsize=(10, 3.4))
    panel = figure.subplots()
    everything = np.concatenate([P for recordings in by_space.values() for P in recordings.values()])
    bins = np.linspace(np.nanmin(everything), np.nanmax(everything), 90).tolist()
    for k, (space, recordings) in enumerate(by_space.items()):
        together, colour = np.concatenate(list(recordings.values())), _COLOURS[k % len(_COLOURS)]
        panel.hist(together, bins=bins, density=True, histtype="step", label=space, color=colour)
    panel.set(xlabel="metered active power P per window [W]", ylabel="probability density [1/W]", yscale="log")
    panel.legend()
    panel.grid(alpha=0.3)
    return figure
