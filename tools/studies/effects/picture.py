"""One picture of a closed loop: measured power, the model before and after, on a held-out recording.

    python -m tools.studies.effects.picture REPORT_FOLDER DATASET OUT.png

REPORT_FOLDER is what `acqd close-loop DATASET` wrote; its report.json names the bundle that the loop started from. The
picture shows the 20 s of held-out data in which the loop reduced the squared error most, and says so of simulated data.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.models.segments import Dataset, Segment, load_dataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WINDOW_S = 20.0
MEASURED, BEFORE, AFTER = "#111827", "#c2410c", "#1d6fa5"
_DOTS_PER_INCH = 150  # times 8 inches: readable at 800 pixels, sharp on dense screens


@dataclass(frozen=True, slots=True)
class Window:
    """The rows to draw."""

    recording: str
    t: Floats
    """[T] s from the first row."""
    measured: Floats
    """[T] W."""
    before: Floats
    """[T] W, predicted by the model that the loop was given."""
    after: Floats
    """[T] W, predicted by the model that the loop returned."""


def report_of(folder: Path) -> dict[str, Any]:
    """The report of a closed loop. Raises UserError."""
    try:
        return dict(json.loads((folder / "report.json").read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise UserError(f"{folder}: holds no report.json that can be read ({error}); run acqd close-loop") from None


def held_out(data: Dataset, provenance: dict[str, Any]) -> list[Segment]:
    """Segments that were not used to find effects, and are long enough to show. Raises UserError."""
    if "closed_on" not in provenance:
        raise UserError("the loop has added nothing to the model: there is no difference to draw")
    if provenance["closed_manifest_sha256"] != data.digest:
        raise UserError(f"{data.path}: is not the dataset that the loop was closed on; name {provenance['closed_on']}")
    used = set(provenance["closed_fit_recordings"])
    segments = [s for s in data.segments if s.recording not in used and len(s.P) * data.step_s > WINDOW_S]
    if not segments:
        raise UserError(f"{data.path}: no held-out recording lasts longer than {WINDOW_S:.0f} s")
    return segments


def best_window(before: Path, after: Path, data: Dataset) -> Window:
    """The held-out rows where the loop reduced the squared error most. Raises UserError, InputError."""
    (_, model_before), (bundle_after, model_after) = open_model(before), open_model(after)
    segments = held_out(data, bundle_after.metadata["provenance"])
    size = round(WINDOW_S / data.step_s)
    largest, window = -np.inf, None
    for segment, old, new in zip(
        segments, predictions(model_before, segments), predictions(model_after, segments), strict=True
    ):
        reduction = np.convolve((segment.P - old) ** 2 - (segment.P - new) ** 2, np.ones(size), "valid")
        if reduction.max() > largest:
            largest, first = float(reduction.max()), int(reduction.argmax())
            rows = slice(first, first + size)
            t = np.arange(size, dtype=np.float64) * data.step_s
            window = Window(segment.recording, t, segment.P[rows], old[rows], new[rows])
    assert window is not None
    return window


def draw(window: Window, report: dict[str, Any]) -> Figure:
    """Power in the upper panel, residuals in the lower one."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MultipleLocator

    figure = Figure(figsize=(8, 4.8), layout="constrained", facecolor="white")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    upper.plot(window.t, window.measured, color=MEASURED, lw=1.6, label="measured")
    for predicted, colour, label in (
        (window.before, BEFORE, "model before"),
        (window.after, AFTER, "model after"),
    ):
        upper.plot(window.t, predicted, color=colour, lw=1.2, label=label)
        lower.plot(window.t, window.measured - predicted, color=colour, lw=1.2)
    upper.set_ylabel("power [W]")
    upper.legend(frameon=False, ncols=3, fontsize=10, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)
    lower.axhline(0, color=MEASURED, lw=0.8)
    lower.set_ylabel("residual [W]")
    lower.xaxis.set_major_locator(MultipleLocator(5.0))
    lower.set_xlim(0.0, WINDOW_S)
    lower.set_xlabel(f"time [s], held-out recording {window.recording}")
    for axes in (upper, lower):
        _plain(axes)
    figure.suptitle(_title(report), fontsize=12, x=0.01, ha="left")
    return figure


def _title(report: dict[str, Any]) -> str:
    causes = "; ".join(_cause(effect) for effect in report["effects"] if effect["added"])
    before, after = (report[model]["rmse"] for model in ("before", "after"))
    label = {"simulated": " (simulated data)", "derived": " (power derived, not metered)"}.get(report["measured"], "")
    return f"Cause: {causes}; held-out RMSE from {before:.2f} to {after:.2f} W{label}"


def _cause(effect: dict[str, Any]) -> str:
    name, parameter = next(iter(effect["parameters"].items()))
    return f"{effect['id']}, {name} {parameter['value']:.3g} {parameter['unit']}"


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color="#e5e7eb", lw=0.8)
    axes.set_axisbelow(True)


def main() -> None:
    """Read the report, choose the window, write the picture."""
    parser = argparse.ArgumentParser(description="One picture of a closed loop.")
    parser.add_argument("report", type=Path, metavar="REPORT_FOLDER", help="what `acqd close-loop` wrote")
    parser.add_argument("dataset", type=Path, metavar="DATASET", help="the dataset that the loop was closed on")
    parser.add_argument("out", type=Path, metavar="OUT.png", help="file to write")
    arguments = parser.parse_args()
    try:
        report = report_of(arguments.report)
        model = Path(report["model"]["bundle"])
        window = best_window(model, arguments.report / "model", load_dataset(arguments.dataset))
        draw(window, report).savefig(arguments.out, dpi=_DOTS_PER_INCH, pil_kwargs={"optimize": True})
    except (UserError, OSError) as error:
        parser.exit(2, f"{parser.prog}: {error}\n")


if __name__ == "__main__":
    main()
