"""The alerting rules for Prometheus."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from acqd.daemon.health.metrics import metrics
from acqd.daemon.health.runbook import RUNBOOK
from acqd.daemon.health.snapshot import Cycles, Delivery, Link, Snapshot

_FOLDER = Path(__file__).parents[2] / "config" / "prometheus"


def test_rules_ask_for_metrics_and_lines_of_the_runbook_that_exist():
    rules = (_FOLDER / "acqd-alerts.yml").read_text()
    snapshot = Snapshot(
        "daemon", "cell", "1", 1.0, True, delivery=Delivery(spool_bytes=1, spool_limit_bytes=2), cycles=Cycles(),
        broker=Link(connected=True), synchronised=True,
    )  # fmt: skip
    page = metrics(snapshot).decode()
    asked = set(re.findall(r"\bacqd_[a-z_]+", " ".join(re.findall(r"expr: (.*)", rules))))
    assert len(asked) >= 7 and [name for name in asked if f"\n{name}{{" not in page] == []
    anchors = {entry.anchor for entry in RUNBOOK}
    named = {name.strip('"') for name in re.findall(r"runbook: (.*)", rules)} - {"{{ $labels.peer }}-away"}
    assert named <= anchors and {"source-away", "broker-away", "database-away"} <= anchors


@pytest.mark.skipif(shutil.which("promtool") is None, reason="needs promtool (Debian: prometheus)")
def test_promtool_accepts_the_rules_and_their_cases():
    for words in (["check", "rules", "acqd-alerts.yml"], ["test", "rules", "acqd-alerts-test.yml"],
                  ["check", "config", "prometheus.yml"]):  # fmt: skip
        done = subprocess.run(["promtool", *words], cwd=_FOLDER, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
