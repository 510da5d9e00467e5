"""The units of systemd."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from tests.places import ROOT

UNITS = [path.stem for path in sorted((ROOT / "systemd").glob("*.service"))]


@pytest.mark.parametrize("unit", UNITS)
def test_units_are_valid_and_strict(unit, tmp_path):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd here")
    text = (ROOT / "systemd" / f"{unit}.service").read_text()
    path = tmp_path / f"{unit.replace('@', '@instance')}.service"
    # The program is not installed in /opt on this machine: verify with one that exists.
    text = text.replace("/opt/acqd/.venv/bin/acqd", "/bin/true").replace("file:/opt/acqd/README.md", "man:true")
    text = re.sub(r"file:/opt/acqd/docs/\w+\.md", "man:true", text)
    path.write_text(text)
    verified = subprocess.run(["systemd-analyze", "verify", path], capture_output=True, text=True, check=False)
    assert verified.returncode == 0 and unit.rstrip("@") not in verified.stderr, verified.stderr
    result = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", path], capture_output=True, text=True, check=False
    )
    if "nrecognized option" in result.stderr:
        pytest.skip("this systemd cannot analyse offline")
    assert "SystemCallErrorNumber=EPERM" in text  # else a call that numpy makes on some machines ends the process
    assert float(re.search(r"exposure level.*: ([\d.]+)", result.stdout).group(1)) <= 2.5


def test_the_timer_of_maintenance_starts_its_service(tmp_path):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd here")
    shutil.copy(ROOT / "systemd" / "acqd-maintain.timer", tmp_path)
    (tmp_path / "acqd-maintain.service").write_text("[Service]\nType=oneshot\nExecStart=/bin/true\n")
    verified = subprocess.run(
        ["systemd-analyze", "verify", tmp_path / "acqd-maintain.timer"], capture_output=True, text=True, check=False
    )
    assert verified.returncode == 0 and "acqd" not in verified.stderr, verified.stderr


def test_a_command_of_the_page_gives_way_and_its_end_is_not_that_of_the_page():
    text = (ROOT / "systemd" / "acqd-web.service").read_text()
    assert "OOMPolicy=continue\n" in text
    filters = [line.partition("=")[2] for line in text.splitlines() if line.startswith("SystemCallFilter=")]
    assert "setpriority" in filters[-1].split() and "@resources" in filters[-2].split()
