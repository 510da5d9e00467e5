"""Energy of the work as JSON, as CSV and as rows of a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

import numpy as np

from acqd.report.digits import number, percent, quantity
from acqd.work.cycle_energy import Cycle, CycleEnergy
from acqd.work.labels import Labelled

CYCLE_HEADER = ("recording", "start (UTC)", "s", "s in motion", "energy", "outlier")
KIND_HEADER = ("path", "cycles", "energy", "standard deviation", "duration", "in motion", "outliers")
LABEL_HEADER = ("time", "in motion", "energy", "mean", "visits", "a visit", "standard deviation")


def when(unix_s: float) -> str:
    """UTC to the millisecond."""
    return datetime.fromtimestamp(unix_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def kinds(energy: CycleEnergy) -> dict[int, list[Cycle]]:
    """Cycles by their path."""
    return {kind: [e for e in energy.cycles if e.kind == kind] for kind in sorted({e.kind for e in energy.cycles})}


def kind_cells(kind: int, cycles: Sequence[Cycle]) -> tuple[str, ...]:
    """A row about all cycles of one path."""
    energy = np.array([each.kWh for each in cycles])
    outliers = [each.outlier for each in cycles if each.outlier]
    named = ", ".join(f"{outliers.count(cause)} {cause}" for cause in dict.fromkeys(outliers))
    return (
        str(kind), str(len(cycles)), _wh(float(energy.mean())), percent(float(energy.std(ddof=1) / energy.mean())),
        f"{number(float(np.median([each.seconds for each in cycles])))} s",
        f"{number(float(np.median([each.moving_s for each in cycles])))} s", named or "none",
    )  # fmt: skip


def cycle_cells(each: Cycle) -> tuple[str, ...]:
    """A row about one cycle."""
    return (
        each.recording, when(each.start_s), f"{each.seconds:.2f}", f"{each.moving_s:.2f}", _wh(each.kWh), each.outlier
    )  # fmt: skip


def label_cells(each: Labelled) -> tuple[str, ...]:
    """A row about one value of a label."""
    visits = each.visits
    spread = percent(float(visits.std(ddof=1) / visits.mean())) if len(visits) > 1 and visits.mean() else "-"
    return (
        each.name, f"{number(each.seconds)} s", percent(each.moving), _wh(each.kWh),
        quantity(3.6e6 * each.kWh / each.seconds, "W", 3), str(len(visits)), _wh(float(visits.mean())), spread,
    )  # fmt: skip


def _wh(kwh: float) -> str:
    return quantity(1000 * kwh, "Wh", 3)


def cycles_json(energy: CycleEnergy) -> dict[str, Any]:
    """For `--json`."""
    return {
        "by": "cycle", "measured_kWh": energy.kWh, "seconds": energy.seconds,
        "kinds": [_kind(kind, cycles) for kind, cycles in kinds(energy).items()],
        "cycles": [_cycle(each) for each in energy.cycles], "between": [asdict(each) for each in energy.between],
    }  # fmt: skip


def _cycle(each: Cycle) -> dict[str, Any]:
    return asdict(each) | {"start": when(each.start_s), "outlier": each.outlier or None}


def _kind(kind: int, cycles: Sequence[Cycle]) -> dict[str, Any]:
    energy = np.array([each.kWh for each in cycles])
    return {
        "kind": kind, "cycles": len(cycles), "kWh_mean": float(energy.mean()), "kWh_sd": float(energy.std(ddof=1)),
        "kWh_median": float(np.median(energy)), "seconds_median": float(np.median([e.seconds for e in cycles])),
        "outliers": sum(bool(e.outlier) for e in cycles),
    }  # fmt: skip


def labels_json(by: str, values: Sequence[Labelled]) -> dict[str, Any]:
    """For `--json`."""
    return {
        "by": by, "measured_kWh": sum(each.kWh for each in values), "seconds": sum(each.seconds for each in values),
        "values": [
            {
                by: each.name, "seconds": each.seconds, "moving": each.moving, "kWh": each.kWh,
                "visits": len(each.visits), "visit_kWh": each.visits.tolist(),
            }
            for each in values
        ],
    }  # fmt: skip


def cycles_csv(energy: CycleEnergy) -> str:
    """One line a cycle, then what lies between; the column kWh adds up to the measured energy."""
    rows: list[Sequence[object]] = [
        (e.recording, when(e.start_s), f"{e.seconds:.4f}", f"{e.moving_s:.4f}", repr(e.kWh), e.kind, e.outlier)
        for e in energy.cycles
    ]
    rows += [("", "", f"{each.seconds:.4f}", "", repr(each.kWh), "", each.name) for each in energy.between]
    return _csv(("recording", "start", "seconds", "moving_s", "kWh", "kind", "remark"), rows)


def labels_csv(by: str, values: Sequence[Labelled]) -> str:
    """One line a value."""
    rows = [(e.name, f"{e.seconds:.4f}", f"{e.moving:.6f}", repr(e.kWh), len(e.visits)) for e in values]
    return _csv((by, "seconds", "moving_share", "kWh", "visits"), rows)


def _csv(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *rows])
    return text.getvalue()
