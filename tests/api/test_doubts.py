"""What the command line prints beside a result reaches a script as a warning."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import orjson
import pytest

import acqd
from acqd.api.doubts import written_twice
from acqd.api.loop import LoopResult


def lines_of(call):
    """The result of a call, and the lines of its warnings, all of which point to this file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = call()
    assert all(Path(each.filename) == Path(__file__) for each in caught), [each.filename for each in caught]
    return result, [str(each.message) for each in caught]


def test_a_log_that_is_left_out_of_a_data_set_is_named(folder):
    logs = sorted((folder / "logs").iterdir())
    (folder / "logs" / "degrees.csv").write_text(in_degrees(logs[0].read_text()))
    data, said = lines_of(lambda: acqd.Dataset.build("power.csv", "logs", "fresh", robot="ur10e"))
    assert "degrees" not in data.recordings
    assert any("degrees.csv" in line and "degrees" in line.split("degrees.csv", 1)[1] for line in said), said


def in_degrees(text):
    """A log whose columns q1.. are in degrees."""
    head, *rows = text.splitlines()
    angles = [k for k, name in enumerate(head.split(",")) if name[0] == "q" and name[1:].isdigit()]
    assert angles
    cells = [row.split(",") for row in rows]
    for row in cells:
        for k in angles:
            row[k] = f"{57.29578 * float(row[k]):.4f}"
    return "\n".join([head, *(",".join(row) for row in cells), ""])


def test_times_without_a_zone_are_doubted(folder):
    Path("naive.csv").write_text(
        "time,P\n" + "".join(f"2026-01-27 08:00:{0.04 * k:06.3f},{60 + k % 7}\n" for k in range(100))
    )
    _, said = lines_of(lambda: acqd.read_rows("naive.csv"))
    assert any("no zone" in line for line in said), said


def test_rows_of_a_log_that_are_left_out_are_said(folder):
    head, *rows = Path("logs/example.csv").read_text().splitlines()
    rows[100] = rows[100].rsplit(",", 2)[0]
    Path("short.csv").write_text("\n".join([head, *rows, ""]))
    _, said = lines_of(lambda: acqd.read_log("short.csv", "ur10e"))
    assert any("1 of" in line for line in said), said
    _, predicted = lines_of(lambda: acqd.predict("model", "short.csv"))
    assert any("1 of" in line for line in predicted), predicted


def test_a_seed_below_zero_is_named(folder):
    with pytest.raises(acqd.UserError, match="seed -1: expected a whole number from 0 on"):
        acqd.train("ds", out="fresh", seed=-1)
    assert not (folder / "fresh").exists()


def test_a_log_in_order_leads_to_no_warning(folder):
    _, said = lines_of(lambda: acqd.read_log("logs/example.csv", "ur10e"))
    assert said == []


@pytest.mark.parametrize(
    ("warnings_", "shown"),
    [(["a < b"], "<ul><li>mind: a &lt; b</li><li>short</li></ul>"), ([], "<ul><li>short</li></ul>")],
)
def test_a_notebook_shows_what_a_verdict_has_to_be_read_with(warnings_, shown):
    report = {"before": {"rmse": 2.0}, "after": {"rmse": 1.0}, "measured": "mains", "verdict": "nothing_left"}
    result = LoopResult(Path("loop"), report | {"effects": [], "warnings": warnings_, "notes": [*warnings_, "short"]})
    assert result._repr_html_().endswith(f"</table>{shown}")


@pytest.mark.parametrize("warned", [[], ["the meter has changed"]])
def test_a_verdict_warns_of_what_it_has_to_be_read_with(folder, monkeypatch, warned):
    def write(config, closed):
        config.out.mkdir()
        (config.out / "report.json").write_bytes(orjson.dumps({"warnings": warned, "notes": warned}))

    monkeypatch.setattr("acqd.discrepancy.loop.close_loop", lambda *_: None)
    monkeypatch.setattr("acqd.discrepancy.report.write.write_all", write)
    _, said = lines_of(lambda: acqd.close_loop("now", "model", "loop"))
    assert said == warned


def rows_of(step_s, resolution, power_s, seconds=20.0):
    """A recording: angles [T, 6] of an encoder, power [T] of a meter that is slower than the rows."""
    time = np.arange(0.0, seconds, step_s)
    q = 0.3 * np.sin(0.4 * time[:, None] + np.arange(6))
    metered = np.unique((time / power_s).astype(int), return_inverse=True)[1]
    y = 200.0 + np.random.default_rng(1).normal(0.0, 3.0, len(time))
    return resolution * np.round(q / resolution), np.round(y[metered], 1)


def twice(X, y, rows):
    [*said] = written_twice(np.repeat(X, rows, axis=0), np.repeat(y, rows), [Rows(int(rows.sum()))])
    return said


class Rows:
    """A recording of so many rows."""

    def __init__(self, count):
        self.valid = np.ones(count, bool)


@pytest.mark.parametrize("share", [0.01, 0.1, 1.0])
def test_rows_that_are_written_twice_are_doubted(share):
    X, y = rows_of(0.04, 1e-4, 0.04)
    rows = 1 + (np.random.default_rng(2).random(len(X)) < share).astype(int)
    assert "rows repeat the row before while the arm moves" in twice(X, y, rows)[0]


@pytest.mark.parametrize("step_s", [0.002, 0.01, 0.04, 0.1])
@pytest.mark.parametrize("resolution", [1e-4, 1.5e-3, 0.0175])
@pytest.mark.parametrize("power_s", [0.002, 0.04, 0.2])
def test_slow_meters_and_coarse_encoders_are_not(step_s, resolution, power_s):
    X, y = rows_of(step_s, resolution, power_s)
    assert twice(X, y, np.ones(len(X), int)) == []
