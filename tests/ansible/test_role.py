"""The Ansible role: what it would do to two PCs."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

from tests.places import ROOT

PLAYBOOK = Path(sys.executable).with_name("ansible-playbook")
HOSTS = {"hall-1": {"acqd_rights": ["raw-network"]}, "hall-2": {"acqd_wheel": ""}}


def test_a_check_changes_nothing_and_a_host_without_a_wheel_is_told(tmp_path):
    (tmp_path / "acqd-2.0-py3-none-any.whl").write_bytes(b"")
    (tmp_path / "tariff.toml").write_text("price = 0.2\n")
    (tmp_path / "acqd.toml.j2").write_text('device = "{{ acqd_device }}"\n')
    settings = {
        "ansible_connection": "local", "ansible_python_interpreter": "/usr/bin/python3", "acqd_become": False,
        "acqd_packages": [], "acqd_venv": str(tmp_path / "opt" / ".venv"), "acqd_extras": ["web"],
        "acqd_wheel": str(tmp_path / "acqd-2.0-py3-none-any.whl"), "acqd_tariff": str(tmp_path / "tariff.toml"),
        "acqd_config": str(tmp_path / "acqd.toml.j2"), "acqd_passwords": {"viewer": "secret"},
    }  # fmt: skip
    (tmp_path / "inventory.json").write_text(json.dumps({"acqd": {"vars": settings, "hosts": HOSTS}}))
    before = sorted(path.name for path in tmp_path.iterdir())
    done = subprocess.run(
        [PLAYBOOK, "-v", "-i", tmp_path / "inventory.json", "site.yml", "--check", "--diff"],
        cwd=ROOT / "ansible", capture_output=True, text=True, check=False,
        env=os.environ | {"ANSIBLE_LOCAL_TEMP": str(tmp_path / "local"), "ANSIBLE_NOCOLOR": "1", "LC_ALL": "C.UTF-8"},
    )  # fmt: skip
    shown = dict(re.findall(r"(?s)TASK \[acqd : ([^]]+)\] \*+\n(.*?)(?=\n\n[A-Z])", done.stdout))
    assert "acqd_wheel is not set" in done.stdout and re.search(r"hall-1 .* failed=0 ", done.stdout), done.stdout
    assert "changed: [hall-1]" in shown["The configuration"] and '+device = "hall-1"' in shown["The configuration"]
    command = shown["User, folders, units, the first configuration"]
    for words in (
        '"service", "install", "--no-start", "--device", "hall-1"',
        '"--rights=raw-network"',
        '"--with=daemon"',
    ):
        assert words in command
    assert "secret" not in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir() if path.name != "local") == before
