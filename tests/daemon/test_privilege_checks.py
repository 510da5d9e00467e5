"""`acqd doctor` on rights, with kernels that refuse them to root."""

from __future__ import annotations

import os
import resource

import pytest

from acqd.daemon import checks, privilege_checks
from acqd.daemon.config import Config
from acqd.daemon.finding import Finding
from acqd.daemon.privilege_checks import NET_RAW, raw_network_access
from tests.commands import acqd_here


def states():
    return {found.check: found.state for found in privilege_checks.privilege_checks(Config())}


@pytest.fixture
def without_capabilities(monkeypatch, tmp_path):
    """A process that holds no capability, whoever its user is."""
    (tmp_path / "status").write_text("Name:\tacqd\nCapEff:\t0000000000000000\n")
    monkeypatch.setattr(privilege_checks, "Path", lambda _: tmp_path / "status")


def test_what_the_kernel_refuses_to_root_is_no_ok(monkeypatch, without_capabilities):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (65_536, 65_536))
    assert states() == {"real-time priority": "warn", "locked memory": "warn"}
    found = raw_network_access([NET_RAW])
    assert found.state == "fail" and "CAP_NET_RAW" in found.finding  # acqd run does not start without it


def test_what_the_kernel_grants_is_ok_and_is_given_back(monkeypatch):
    asked = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda _, policy, __: asked.append(policy))
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert states() == {"real-time priority": "ok", "locked memory": "ok"}
    assert asked == [os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_getscheduler(0)]


def test_the_table_cuts_no_port_and_no_path(monkeypatch):
    address = "mqtts://broker-of-the-third-hall.plant.example.org:18883"
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(checks, "all_checks", lambda _: [Finding("broker", "warn", address, "start it")])
    shown = acqd_here("doctor").stdout
    cells = [line.split("│")[3].strip() for line in shown.splitlines() if line.startswith("│")]
    assert "".join(cells) == address
