"""The comparison as one self-contained page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd.models.compare import pictures
from acqd.models.compare.evaluate import Comparison, Entry
from acqd.models.compare.kernels import likeness
from acqd.models.networks.predictor import NetworkPredictor
from acqd.report import Page

_MANUAL = ("7x1dim", "14x1dim", "21x1dim")
_FIGURES = (
    ("Manually engineered features (Figure 8.3)", _MANUAL),
    ("Convolution as feature extraction (Figure 8.6)", ("14x1dim", "21x1dim", "2conv1x3", "3conv1x3")),
    ("Wider kernels (Figure 8.11)", ("21x1dim", "3conv1x5", "5conv1x21", "3conv1x11")),
)


def write_report(comparison: Comparison, path: Path) -> None:
    """Write it. Raises UserError."""
    data = comparison.data
    page = Page(f"Models of the power of {data.robot}", simulated=data.measured == "simulated")
    if data.measured == "derived":
        page.text("Power is derived from other measurements, not metered: errors are against that derived power.")
    best = comparison.best()
    m = best.metrics["everything"]
    page.text(
        f"Best on {m.recordings} held-out recordings: {best.label}, trained on "
        f"{pictures.kind_label(best.trained_on)}: MAE {m.mae:.2f} W "
        f"(95 % {best.mae_ci95[0]:.2f} to {best.mae_ci95[1]:.2f}), RMSE {m.rmse:.2f} W, energy of a recording within "
        f"{100 * m.energy_p95:.2f} % for 95 % of them."
        + (f" A perfect model would have about {comparison.floor_W:.2f} W MAE." if comparison.floor_W else "")
    )
    for note in comparison.notes:
        page.text(note)
    _table(page, comparison)
    _heatmaps(page, comparison)
    on_all = sorted(
        (entry for entry in comparison.entries if entry.trained_on == "everything"),
        key=lambda entry: entry.metrics["everything"].mae,
    ) or [best]
    page.heading("Distribution of errors (Figures 8.4, 8.7, 8.12, 8.17)")
    page.figure(pictures.violins(on_all + comparison.baselines), "Absolute errors on all held-out recordings.")
    page.heading("Energy of a recording")
    page.figure(pictures.energy(comparison, on_all), "Predicted beside measured energy of each held-out recording.")
    _samples(page, comparison, on_all)
    _parameters(page, on_all)
    _kernels(page, comparison, on_all)
    page.write(path)


def _table(page: Page, comparison: Comparison) -> None:
    page.heading("All models (Figure 8.16)")
    rows: list[list[object]] = []
    for entry in sorted(comparison.entries, key=lambda e: e.metrics["everything"].mae) + comparison.baselines:
        m = entry.metrics["everything"]
        low, high = entry.mae_ci95
        learnables = entry.metadata.get("architecture", {}).get(
            "learnables", len(entry.metadata.get("parameters", [])) or "-"
        )
        rows.append(
            [
                *(
                    entry.label,
                    pictures.kind_label(entry.trained_on),
                    learnables,
                    entry.seeds,
                    m.mae,
                    f"{low:.2f} to {high:.2f}",
                ),
                *(m.rmse, m.bias, 100 * m.energy_p95, f"{100 * entry.unstable:.2f} %"),
            ]
        )
    header = ["model", "trained on", "parameters", "seeds", "MAE [W]", "95 %", "RMSE [W]", "bias [W]"]
    page.table([*header, "energy p95 [%]", "unstable"], rows)
    if comparison.floor_W is not None:
        page.text(
            f"Noise floor: {comparison.floor_W:.2f} W MAE, how power scatters while the robot stands still. Intervals: "
            "bootstrap over source trajectories, and over seeds where there are several. Unstable: seconds in which "
            "a prediction oscillates four times as much as the measurement (Figure 8.5)."
        )


def _heatmaps(page: Page, comparison: Comparison) -> None:
    if len(comparison.data.kinds) > 1:
        page.heading("What they were trained on (Figure 8.1)")
        found = [e for e in comparison.entries if e.name in _MANUAL]
        found = sorted(found, key=lambda e: (_MANUAL.index(e.name), e.trained_on))
        if found:
            rows = [f"{e.name}, trained on {pictures.kind_label(e.trained_on)}" for e in found]
            page.figure(pictures.heatmap(found, comparison.kinds, rows), "MAE [W] on each kind of held-out recordings.")
    for title, names in _FIGURES:
        found = [e for name in names if (e := comparison.find(name, "everything"))]
        if len(found) > 1:
            page.heading(title)
            page.figure(pictures.heatmap(found, comparison.kinds, [e.label for e in found]), "MAE [W].")
    everything = sorted(comparison.entries, key=lambda e: e.metrics["everything"].mae) + comparison.baselines
    page.heading("Every model (Figure 8.16)")
    rows = [f"{e.label} ({pictures.kind_label(e.trained_on)})" for e in everything]
    page.figure(pictures.heatmap(everything, comparison.kinds, rows), "MAE [W].")


def _samples(page: Page, comparison: Comparison, entries: list[Entry]) -> None:
    page.heading("Sample predictions (Figures 8.2, 8.18)")
    reference = comparison.find("21x1dim", "everything") or entries[0]
    mae = [float(np.abs(guess - s.P).mean()) for guess, s in zip(reference.predicted, comparison.test, strict=True)]
    shown = list(dict.fromkeys([reference, *entries[:2]]))
    for which, caption in ((int(np.argmax(mae)), "largest"), (int(np.argmin(mae)), "smallest")):
        segment = comparison.test[which]
        chosen = [(entry.label, entry.predicted[which]) for entry in shown]
        figure = pictures.sample(segment, comparison.data.step_s, chosen)
        page.figure(figure, f"{segment.recording}: where {reference.label} has its {caption} MAE.")


def _parameters(page: Page, entries: list[Entry]) -> None:
    for entry in entries:
        if not entry.metadata.get("parameters"):
            continue
        page.heading(f"Parameters of {entry.label}")
        rows = [
            [p["name"], p["value"], p["unit"], f"{p['ci95'][0]:.4g} to {p['ci95'][1]:.4g}" if p["ci95"] else ""]
            for p in entry.metadata["parameters"]
            if p["name"].split(".")[0] not in ("Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
        ]
        page.table(["parameter", "value", "unit", "95 %"], rows)
        return


def _kernels(page: Page, comparison: Comparison, entries: list[Entry]) -> None:
    example = comparison.test[0].q[:, 0]
    for entry in entries:
        if not isinstance(entry.model, NetworkPredictor) or not entry.model.architecture.kernels:
            continue
        weights = np.asarray(entry.model.arrays["kernel"], dtype=np.float64)
        page.heading(f"Kernels of {entry.label} (Figures 8.8 to 8.15)")
        normal = entry.model.normal.inputs(0, np.tile(example[:, None], (1, comparison.data.axes)))[:, 0]
        page.figure(pictures.kernels(weights, comparison.data.step_s, normal), "Learned kernels beside DoG and LoG.")
        rows: list[list[object]] = []
        for k, weight in enumerate(weights):
            like = likeness(weight)
            shares = [f"{100 * share:.0f} %" for share in (like.smoothing, like.first, like.second, like.rest)]
            rows.append([f"w{k + 1}", like.name, *shares])
        page.table(["kernel", "most like", "mean", "DoG", "LoG", "rest"], rows)


def as_json(comparison: Comparison) -> dict[str, Any]:
    """For --json."""
    return {
        "robot": comparison.data.robot,
        "measured": comparison.data.measured,
        "noise_floor_W": comparison.floor_W,
        "notes": comparison.notes,
        "models": [_entry_json(entry) for entry in comparison.entries],
        "baselines": [_entry_json(entry) for entry in comparison.baselines],
    }


def _entry_json(entry: Entry) -> dict[str, Any]:
    return {
        "name": entry.name,
        "trained_on": entry.trained_on,
        "seeds": entry.seeds,
        "mae_ci95": list(entry.mae_ci95),
        "unstable_share": entry.unstable,
        "test": {kind: metrics.as_json() for kind, metrics in entry.metrics.items()},
    }
