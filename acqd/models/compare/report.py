"""The comparison as one self-contained HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd.models.compare import pictures
from acqd.models.compare.evaluate import Comparison, Entry
from acqd.models.compare.kernels import likeness
from acqd.models.networks.predictor import NetworkPredictor
from acqd.report import KeyFigure, Page, Verdict
from acqd.report.bars import Bar, Bars, ranked
from acqd.report.digits import FEWEST_FOR_INTERVAL, confidence_interval, counted, interval, number, percent, with_error
from acqd.report.lines import Chart, Line, Panel
from acqd.report.verdict import Tone

_SHOWN_S = 60.0
_MANUAL = ("7x1dim", "14x1dim", "21x1dim")
_HEATMAPS = (
    ("Manually engineered features", "8.3", _MANUAL),
    ("Convolution as feature extraction", "8.6", ("14x1dim", "21x1dim", "2conv1x3", "3conv1x3")),
    ("Wider kernels", "8.11", ("21x1dim", "3conv1x5", "5conv1x21", "3conv1x11")),
)
"""Heading, figure of the thesis, and networks."""
_MAE = "MAE [W] on each kind of held-out recordings."


def write_report(comparison: Comparison, path: Path) -> None:
    """Write the report to `path`. Raises UserError."""
    data = comparison.data
    page = Page(
        f"Models of the power of {data.robot}",
        simulated=data.measured == "simulated", kind="models", subject=data.robot,
    )  # fmt: skip
    page.verdict(_verdict(comparison))
    if data.measured == "derived":
        page.text("The power was derived from other measurements, not metered. Errors are against that derived power.")
    best = comparison.best()
    page.bars(_mean_errors(comparison), "The best model first.")
    _minute(page, comparison, best)
    _table(page, comparison)
    on_all = sorted(
        (entry for entry in comparison.entries if entry.trained_on == "everything"),
        key=lambda entry: entry.metrics["everything"].mae,
    ) or [best]
    _heatmaps(page, comparison)
    page.heading("Distribution of errors")
    page.figure(
        pictures.violins(on_all + comparison.baselines),
        "Absolute errors on all held-out recordings. Thick line: quartiles; dot: median.",
        source="Thesis Figures 8.4, 8.7, 8.12, 8.17.",
    )
    page.heading("Energy of a recording")
    page.figure(
        pictures.energy(comparison, on_all),
        "Predicted over measured energy minus 1, one mark for each held-out recording. Band: within 1 %.",
    )
    _samples(page, comparison, on_all)
    _parameters(page, on_all)
    _kernels(page, comparison, on_all)
    page.detail("dataset", data.path)
    page.detail("dataset SHA-256", data.digest)
    page.detail("seeds", ", ".join(f"{entry.name}: {entry.seeds}" for entry in comparison.entries))
    page.write(path)


def _verdict(comparison: Comparison) -> Verdict:
    best, m = comparison.best(), comparison.best().metrics["everything"]
    rival = min((e.metrics["everything"].mae for e in comparison.entries if e is not best), default=None)
    figures = [
        KeyFigure("mean absolute error", f"{number(m.mae)} W", confidence_interval(best.mae_ci95, m.recordings)),
        KeyFigure(
            "energy of a recording",
            f"± {percent(m.energy_p95)}",
            f"for 95 % of {counted(m.recordings, 'recording')}",
        ),
        KeyFigure("noise of the measurement", f"{number(comparison.floor_W, 2)} W", f"MAE, {comparison.floor_where}"),
    ]
    if rival is not None:
        figures.insert(
            1, KeyFigure("next best model", f"{number(rival)} W", f"{number(rival / m.mae, 2)} times the error")
        )
    headline = f"{best.name} predicts the power best: {number(m.mae)} W mean absolute error"
    tone: Tone = "found"
    simplest = min(comparison.baselines, key=lambda entry: entry.metrics["everything"].mae, default=best)
    if (least := simplest.metrics["everything"].mae) < m.mae:
        headline = f"No model predicts better than {simplest.name}: {number(least)} W, {best.name} {number(m.mae)} W"
        tone = "open"
    notes = " ".join(f"{note[0].upper()}{note[1:]}." for note in comparison.notes)
    return Verdict(tone, headline, f"Trained on {pictures.kind_label(best.trained_on)}. {notes}".strip(), figures)


def _interval(entry: Entry) -> str:
    """Of the MAE [W], from resampled source trajectories and seeds."""
    few = entry.metrics["everything"].recordings < FEWEST_FOR_INTERVAL
    return "-" if few else interval(*entry.mae_ci95)


def _mean_errors(comparison: Comparison) -> Bars:
    best = comparison.best()
    rows = [
        Bar(
            f"{entry.name}, {pictures.kind_label(entry.trained_on)}" if entry.model else entry.name,
            (mae := entry.metrics["everything"].mae),
            f"{number(mae)} W, {number(mae / best.metrics['everything'].mae, 2)} x",
            "after" if entry is best else ("before" if entry.model else "muted"),
        )
        for entry in [*comparison.entries, *comparison.baselines]
    ]
    return ranked(
        rows, "Mean absolute error on held-out recordings [W], and relative to the best", smaller_is_better=True
    )


def _minute(page: Page, comparison: Comparison, best: Entry) -> None:
    """Measured and predicted power of the recording whose error is the median."""
    errors = [float(np.abs(p - s.P).mean()) for p, s in zip(best.predicted, comparison.test, strict=True)]
    k = int(np.argsort(errors)[len(errors) // 2])
    segment, step_s = comparison.test[k], comparison.data.step_s
    rows = slice(0, int(_SHOWN_S / step_s))
    P, predicted = segment.P[rows], best.predicted[k][rows]
    panels = [
        Panel("P [W]", [Line("measured", P), Line(best.name, predicted, "after")]),
        Panel("error [W]", [Line("predicted minus measured", predicted - P, "before")], 100, zero=True),
    ]
    alt = f"Measured power of {segment.recording} and power predicted by {best.name}: MAE {errors[k]:.2f} W"
    chart = Chart(step_s * np.arange(len(P)), f"time in {segment.recording} [s]", panels, alt)
    page.lines(chart, f"The held-out recording whose error is the median: {segment.recording}.")


def _table(page: Page, comparison: Comparison) -> None:
    page.heading("All models")
    rows: list[list[object]] = []
    for entry in sorted(comparison.entries, key=lambda e: e.metrics["everything"].mae) + comparison.baselines:
        m = entry.metrics["everything"]
        learnables = entry.metadata.get("architecture", {}).get(
            "learnables", len(entry.metadata.get("parameters", [])) or "-"
        )
        watts = (f"{m.mae:.2f}", _interval(entry), f"{m.rmse:.2f}", f"{m.bias:.2f}")
        shares = (f"{100 * m.energy_p95:.2f}", f"{100 * entry.unstable:.2f}")
        rows.append([entry.name, pictures.kind_label(entry.trained_on), learnables, entry.seeds, *watts, *shares])
    header = ["model", "trained on", "parameters", "seeds", "MAE [W]", "95 % interval [W]", "RMSE [W]", "bias [W]"]
    page.table([*header, "energy p95 [%]", "unstable [%]"], rows)
    count = comparison.best().metrics["everything"].recordings
    held_out = counted(count, "held-out recording")
    intervals = f"Intervals of the MAE from {held_out}: bootstrap over source trajectories and seeds."
    if count < FEWEST_FOR_INTERVAL:
        intervals = f"No intervals: {held_out} would say next to nothing about others."
    page.text(
        f"{intervals} Bias: predicted minus measured. Energy p95: 95 % of "
        "the recordings have a smaller relative error of their energy. Unstable: share of seconds in which the second "
        "difference of the prediction is more than four times that of the measurement."
    )
    page.text(
        f"Noise floor: {comparison.floor_W:.2f} W MAE, which is sqrt(2 / pi) times the RMS of the noise, measured "
        f"{comparison.floor_where}."
    )


def _heatmaps(page: Page, comparison: Comparison) -> None:
    if len(comparison.data.kinds) > 1:
        page.heading("Effect of the training data")
        entries = [e for e in comparison.entries if e.name in _MANUAL]
        entries = sorted(entries, key=lambda e: (_MANUAL.index(e.name), e.trained_on))
        if entries:
            rows = [f"{e.name}, trained on {pictures.kind_label(e.trained_on)}" for e in entries]
            page.figure(pictures.heatmap(entries, comparison.kinds, rows), _MAE, source=_figure("8.1"))
    for title, thesis, names in _HEATMAPS:
        entries = [e for name in names if (e := comparison.find(name, "everything"))]
        if len(entries) > 1:
            page.heading(title)
            rows = [e.name for e in entries]
            page.figure(pictures.heatmap(entries, comparison.kinds, rows), _MAE, source=_figure(thesis))
    everything = sorted(comparison.entries, key=lambda e: e.metrics["everything"].mae) + comparison.baselines
    page.heading("All models and baselines by kind of recording")
    rows = [f"{e.name} ({pictures.kind_label(e.trained_on)})" for e in everything]
    page.figure(pictures.heatmap(everything, comparison.kinds, rows), _MAE, source=_figure("8.16"))


def _figure(number: str) -> str:
    return f"Thesis Figure {number}."


def _samples(page: Page, comparison: Comparison, entries: list[Entry]) -> None:
    page.heading("Sample predictions")
    reference = comparison.find("21x1dim", "everything") or entries[0]
    pairs = zip(reference.predicted, comparison.test, strict=True)
    mae = [float(np.abs(predicted - segment.P).mean()) for predicted, segment in pairs]
    shown = list(dict.fromkeys([reference, *entries[:2]]))
    for which, caption in ((int(np.argmax(mae)), "largest"), (int(np.argmin(mae)), "smallest")):
        segment = comparison.test[which]
        chosen = [(entry.name, entry.predicted[which]) for entry in shown]
        figure = pictures.sample(segment, comparison.data.step_s, chosen)
        text = f"{segment.recording}: {caption} MAE of {reference.name}."
        page.figure(figure, text, source="Thesis Figures 8.2, 8.18.")


def _parameters(page: Page, entries: list[Entry]) -> None:
    for entry in entries:
        if not entry.metadata.get("parameters"):
            continue
        page.heading(f"Parameters of {entry.name}")
        rows = [
            [p["name"], *_value_with_interval(p), p["unit"]]
            for p in entry.metadata["parameters"]
            if p["name"].split(".")[0] not in ("Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
        ]
        with page.folded(f"{len(rows)} fitted values; the intervals are those of the fit"):
            page.table(["parameter", "value", "95 % interval", "unit"], rows)
        return


def _value_with_interval(parameter: dict[str, Any]) -> tuple[str, str]:
    value, bounds = float(parameter["value"]), parameter["ci95"]
    if not bounds:
        return number(value), "-"
    return with_error(value, (bounds[1] - bounds[0]) / 2), interval(*bounds)


def _kernels(page: Page, comparison: Comparison, entries: list[Entry]) -> None:
    example = comparison.test[0].q[:, 0]
    for entry in entries:
        if not isinstance(entry.model, NetworkPredictor) or not entry.model.architecture.kernels:
            continue
        weights = np.asarray(entry.model.arrays["kernel"], dtype=np.float64)
        page.heading(f"Kernels of {entry.name}")
        caption = (
            f"Learned kernels w of {entry.name}, compared with the difference of Gaussian (DoG) and the Laplacian of "
            "Gaussian (LoG)."
        )
        normal = entry.model.normal.inputs(0, np.tile(example[:, None], (1, comparison.data.axes)))[:, 0]
        page.figure(
            pictures.kernels(weights, comparison.data.step_s, normal), caption, source="Thesis Figures 8.8 to 8.15."
        )
        rows: list[list[object]] = []
        for k, weight in enumerate(weights):
            like = likeness(weight)
            shares = [percent(share) for share in (like.smoothing, like.first, like.second, like.rest)]
            rows.append([f"w{k + 1}", like.name, *shares])
        page.table(["kernel", "computes mostly", "constant", "DoG", "LoG", "rest"], rows)
        page.text("Shares of the squared norm of each kernel along the constant kernel, DoG and LoG.")


def as_json(comparison: Comparison) -> dict[str, Any]:
    """The figures for --json."""
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
