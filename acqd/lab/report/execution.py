"""The report of `acqd lab execute`: power, what the effects add, energy balance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from acqd.arrays import Floats
from acqd.lab.cell import Cell
from acqd.lab.session import SessionTruth, windows_within
from acqd.motion.controller import RATE
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, ranked
from acqd.report.digits import number, percent
from acqd.report.lines import Chart, Line, Panel

_J_PER_WH = 3600.0
_NEGLIGIBLE_W = 1e-6


def execution_report(cell: Cell, truth: SessionTruth, q: Floats, folder: Path) -> Path:
    """Power and joint angles of one execution, and its energy balance."""
    recording = truth.recordings[0]
    page = Page(
        f"{recording.name} on the virtual {cell.robot.title}",
        simulated=True,
        kind="laboratory",
        subject=cell.robot.name,
    )
    within = windows_within(recording.start_s, recording.seconds, truth.window_s)
    page.verdict(_verdict(cell, truth, within))
    page.lines(_power(truth, within), "Metered power, and what the meter adds to the true power.")
    page.heading("Power and joint angles")
    page.figure(_motion(cell, truth, q, within), "Mains power and joint angles.", folder / "power.png")
    page.heading("Energy balance")
    _balance(page, truth)
    page.detail("seed", cell.settings.seed)
    path = folder / "report.html"
    page.write(path)
    return path


def _verdict(cell: Cell, truth: SessionTruth, within: slice) -> Verdict:
    P, recording = truth.metered[within], truth.recordings[0]
    hidden = truth.power[within] - truth.clean_power[within]
    energy_J = float(np.nansum(truth.power[within])) * truth.window_s
    names = ", ".join(effect.id for effect in cell.settings.effects)
    mean, extremes = f"{np.nanmean(P):.1f} W", f"99 %: {np.nanpercentile(P, 99):.0f} W; most: {np.nanmax(P):.0f} W"
    energy = f"{number(energy_J / _J_PER_WH)} Wh"
    figures = [KeyFigure("mean power", mean, extremes)]
    figures.append(KeyFigure("energy", energy, f"{number(energy_J / 1000)} kJ in {recording.seconds:.1f} s"))
    if cell.settings.effects:
        rms = f"{number(float(np.sqrt(np.mean(hidden**2))))} W RMS"
        figures.append(KeyFigure("effects add", rms, f"{names}; most: {np.abs(hidden).max():.0f} W"))
    error = f"{truth.energy['unaccounted_share']:.0e}"
    figures.append(KeyFigure("energy balance error", error, "of the supplied energy"))
    headline = f"{recording.name} took {recording.seconds:.1f} s and {energy}"
    return Verdict("fine", headline, "", figures)


def _power(truth: SessionTruth, within: slice) -> Chart:
    recording = truth.recordings[0]
    t = np.arange(within.start, within.stop) * truth.window_s - recording.start_s
    hidden = truth.power[within] - truth.clean_power[within]
    lines = [Line("metered", truth.metered[within])]
    panels = [Panel("P [W]", lines)]
    if np.abs(hidden).max() > _NEGLIGIBLE_W:
        lines.insert(0, Line("without effects", truth.clean_power[within], "before"))
        panels.append(Panel("effects [W]", [Line("effects", hidden, "after")], 90, zero=True))
    error = Line("metered minus true", truth.metered[within] - truth.power[within], "muted")
    panels.append(Panel("error [W]", [error], 90, zero=True))
    alt = f"Power of {recording.name} over {recording.seconds:.0f} s, mean {np.nanmean(truth.metered[within]):.0f} W"
    return Chart(t, "time [s]", panels, alt)


def _motion(cell: Cell, truth: SessionTruth, q: Floats, within: slice) -> Figure:
    t = np.arange(within.start, within.stop) * truth.window_s - truth.recordings[0].start_s
    figure = Figure(figsize=(10, 6))
    power, angles = figure.subplots(2, 1, sharex=True, height_ratios=(3, 3))
    power.plot(t, truth.metered[within], color="#2563eb", linewidth=1)
    power.set_ylabel("metered active power P [W]")
    for axis, joint in enumerate(cell.robot.joint):
        angles.plot(np.arange(0, len(q), 20) / RATE, np.degrees(q[::20, axis]), linewidth=0.9, label=joint.name)
    angles.set(xlabel="time [s]", ylabel="joint angle [°]")
    angles.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for panel in (power, angles):
        panel.grid(alpha=0.3)
    figure.tight_layout()
    return figure


def _balance(page: Page, truth: SessionTruth) -> None:
    """Where the energy went."""
    energy = truth.energy
    supplied = max(abs(energy["supplied_J"]), 1e-9)
    bars = [
        Bar(name, joules, f"{number(joules)} J, {percent(joules / supplied)}")
        for name, joules in energy["dissipated_J"].items()
    ]
    page.bars(ranked(bars, "Dissipated energy [J], and its share of the supplied energy [%]"), "")
    rows = [["supplied by the mains", energy["supplied_J"]], ["increase of stored energy", energy["stored_J"]]]
    page.table(["over the whole session, with its pauses", "energy [J]"], rows)
    page.text(f"Balance error: {energy['unaccounted_share']:.1e} of the supplied energy.")
