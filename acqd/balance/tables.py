"""A balance as JSON and as CSV."""

from __future__ import annotations

import csv
import io
from typing import Any

from acqd.balance.balance import Balance, Entry, Span

_HEADER = ("span", "cause", "part", "joint", "kWh", "mean_W", "EUR")


def as_json(balance: Balance) -> dict[str, Any]:
    """For `--json`: the total and every span."""
    return {"by": balance.by, "total": _span(balance.total), "spans": [_span(each) for each in balance.spans]}


def _span(span: Span) -> dict[str, Any]:
    half = span.residual_half
    returned = span.returned
    return {
        "span": span.label, "seconds": span.seconds, "moving": span.moving, "measured_kWh": span.measured,
        "predicted_kWh": span.predicted, "EUR": span.EUR,
        "causes": {cause.value: kwh for cause, kwh in span.by_cause().items()},
        "parts": [_entry(each) for each in span.entries],
        "residual": {
            "kWh": span.residual, "ci95": None if half is None else [span.residual - half, span.residual + half]
        },
        "given_back": {
            "kWh": float(returned.joints.sum()), "joints_kWh": returned.joints.tolist(),
            "to_joints_kWh": returned.to_joints, "to_electronics_kWh": returned.to_electronics,
            "burnt_kWh": returned.burnt, "to_mains_kWh": returned.to_mains,
        },
    }  # fmt: skip


def _entry(entry: Entry) -> dict[str, Any]:
    return {
        "cause": entry.cause.value, "part": entry.name, "added": entry.added, "kWh": entry.kWh, "EUR": entry.EUR,
        "joints_kWh": entry.joints[:-1].tolist(), "of_no_joint_kWh": float(entry.joints[-1]),
    }  # fmt: skip


def as_csv(balance: Balance) -> str:
    """One line a span, part and joint; the lines of a span add up to its measured energy."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_HEADER)
    for span in balance.spans:
        for entry in span.entries:
            costs = [None] * len(entry.joints) if entry.EUR_joints is None else entry.EUR_joints.tolist()
            for joint, (kwh, cost) in enumerate(zip(entry.joints.tolist(), costs, strict=True), start=1):
                if kwh:
                    name = "" if joint == len(entry.joints) else joint
                    table.writerow([span.label, entry.cause.value, entry.name, name, *_numbers(span, kwh, cost)])
        table.writerow([span.label, "residual", "measured minus predicted", "", *_numbers(span, span.residual, None)])
    return text.getvalue()


def _numbers(span: Span, kwh: float, cost: float | None) -> list[object]:
    return [repr(kwh), f"{kwh * 3.6e6 / span.seconds:.6g}", "" if cost is None else f"{cost:.6g}"]
