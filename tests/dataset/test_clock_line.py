"""The line through the clocks of many logs."""

import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.dataset.manifest import load_manifest
from tests.campaigns import quiet


def test_one_clock_that_was_set_in_between_is_announced(campaign, tmp_path):
    made, true = campaign
    if made.settings.robot != "iiwa7_r800":
        pytest.skip("one robot is enough")
    logs = tmp_path / "logs"
    logs.mkdir()
    paths = sorted(made.out.rglob("logs/*/*"))
    for path in paths:
        (logs / path.name).write_text(path.read_text())
    lines = (logs / paths[2].name).read_text().splitlines()
    shifted = [lines[0]]
    for line in lines[1:]:
        seconds, ns, rest = line.split(" ", 2)
        ms = int(seconds) * 1000 + int(ns) // 1_000_000 + 200
        shifted.append(f"{ms // 1000} {ms % 1000 * 1_000_000} {rest}")
    (logs / paths[2].name).write_text("\n".join([*shifted, ""]))
    report = build(BuildConfig(str(made.out / "power.sqlite"), logs, tmp_path / "ds", made.settings.robot), quiet)
    assert len(report.notes) == 1 and paths[2].name in report.notes[0] and "was it set?" in report.notes[0]
    entry = next(e for e in load_manifest(tmp_path / "ds")["recordings"] if e["name"] == paths[2].stem)
    expected = true[paths[2].stem] + 0.2
    assert entry["lag_by"] == "own" and entry["lag_s"] == pytest.approx(expected, abs=0.01)
