"""Figures of the use case: motion, power and initial peak."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from tools.studies.thesis.assembly import CLOSED, GREY_BOX, NETWORK, Case, flange, without_peak


def motion_picture(case: Case) -> Figure:
    """Measured and simulated joint angles and flange positions (thesis Figure 9.3)."""
    arm, twin, segment, step_s = case.arm, case.twins[0], case.held_out[0], case.data.step_s
    figure = Figure(figsize=(11, 9))
    axes = figure.subplots(segment.q.shape[1], 2, sharex=True)
    t = step_s * np.arange(len(twin.q))
    for k in range(segment.q.shape[1]):
        axes[k, 0].plot(t, np.degrees(segment.q[:, k]), color="#000000", lw=1)
        axes[k, 0].plot(t, np.degrees(twin.q[:, k]), color="#b45309", lw=1, ls="--")
        axes[k, 0].set_ylabel(f"q{k + 1} [deg]", fontsize=8)
    measured, simulated = flange(arm, segment.q), flange(arm, twin.q)
    for k, name in enumerate("xyz"):
        axes[k, 1].plot(t, measured[:, k], color="#000000", lw=1, label="measured")
        axes[k, 1].plot(t, simulated[:, k], color="#b45309", lw=1, ls="--", label="twin")
        axes[k, 1].set_ylabel(f"{name} [m]", fontsize=8)
    axes[0, 1].legend(fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1, 1), frameon=False)
    axes[3, 1].plot(t, 1000 * np.linalg.norm(measured - simulated, axis=1), color="#52606d", lw=1)
    axes[3, 1].set_ylabel("distance [mm]", fontsize=8)
    for k in range(4, segment.q.shape[1]):
        axes[k, 1].axis("off")
    axes[-1, 0].set_xlabel("time [s]")
    axes[3, 1].set_xlabel("time [s]")
    return figure


def power_picture(case: Case, name: str, *, peak: bool) -> Figure:
    """Measured, predicted and simulated power, with or without the peak (thesis Figures 9.4, C.2)."""
    figure = Figure(figsize=(11, 6))
    axes = figure.subplots(2, 1, sharex=True)
    segment = case.held_out[0]
    shown = np.ones(len(segment.P), dtype=bool) if peak else without_peak(segment, case.data.step_s)
    t = case.data.step_s * np.arange(len(segment.P))
    both = (("predicted", case.predicted(name)[0]), ("simulated", case.simulated(name)[0]))
    for axis, (kind, power) in zip(axes, both, strict=True):
        axis.plot(t, np.where(shown, segment.P, np.nan), color="#000000", lw=1, label="measured")
        axis.plot(
            t[: len(power)], np.where(shown[: len(power)], power, np.nan), color="#b45309", lw=1, ls="--", label=kind
        )
        axis.set_ylabel("power [W]")
        axis.legend(fontsize=8)
    axes[1].set_xlabel("time [s]")
    return figure


def peak_picture(case: Case) -> Figure:
    """Measured and predicted power around the opening of the brakes."""
    figure = Figure(figsize=(9, 4))
    axis = figure.subplots()
    segment, step_s = case.held_out[0], case.data.step_s
    middle = int(np.argmax(np.diff(segment.signals["brake"], prepend=0.0) > 0))
    rows = slice(max(middle - 15, 0), middle + 40)
    t = step_s * (np.arange(len(segment.P)) - middle)
    axis.plot(t[rows], segment.P[rows], color="#000000", lw=2, label="measured")
    for name, color, style in (
        (NETWORK, "#94a3b8", ":"), (GREY_BOX, "#b45309", "--"), (CLOSED, "#1d6fa5", "-")
    ):  # fmt: skip
        axis.plot(t[rows], case.predicted(name)[0][rows], color=color, lw=1.4, ls=style, label=name)
    axis.set_xlabel("time since the brakes opened [s]")
    axis.set_ylabel("power [W]")
    axis.legend(fontsize=8)
    return figure
