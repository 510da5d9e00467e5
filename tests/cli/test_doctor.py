"""`acqd doctor` and `acqd jitter` as a user runs them."""

from __future__ import annotations

import json

from tests.commands import acqd, acqd_here


def test_doctor_and_jitter_speak_json(tmp_path):
    findings = json.loads(acqd_here("doctor", "--json", cwd=tmp_path).stdout)
    assert {"python", "broker", "database"} <= {finding["check"] for finding in findings}
    report = json.loads(acqd("jitter", "--duration", "1", "--json", cwd=tmp_path).stdout)
    assert sum(report["histogram_us"].values()) == report["cycles"] > 0
