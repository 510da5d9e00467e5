"""`acqd doctor` on the configured source."""

from __future__ import annotations

import socket

import pytest

from acqd.daemon.source_checks import source_checks
from acqd.daemon.source_sections import (
    AdsSection,
    EthercatSection,
    MetersSection,
    ModbusSection,
    SampledValuesSection,
    SimulatedSection,
)
from tests.doubles.modbus import ModbusRtuDouble, PlainBank

METER = [{"name": "m", "profile": "em340"}]


def states(section):
    return {finding.check: (finding.state, finding.finding) for finding in source_checks(section)}


def test_interfaces_are_looked_at():
    assert states(EthercatSection(kind="ethercat", interface="lo"))["source interface"][0] in ("ok", "warn")
    found = states(SampledValuesSection(kind="sampled-values", interface="nowhere0"))
    assert found["source interface"] == ("fail", "nowhere0 does not exist")
    assert "raw network access" in found


def test_tcp_devices_are_called():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert states(ModbusSection(kind="modbus", host="127.0.0.1", port=port))["source"][0] == "ok"
    assert states(ModbusSection(kind="modbus", host="127.0.0.1", port=port))["source"][0] == "fail"
    ads = AdsSection(kind="ads", host="127.0.0.98", ams_net_id="1.2.3.4.1.1")
    assert states(ads)["source"] == ("fail", "127.0.0.98:48898 does not answer (Connection refused)")


def test_serial_ports_are_looked_at():
    with ModbusRtuDouble({1: PlainBank([0])}) as double:
        section = MetersSection(kind="meters", serial_port=double.path, meters=METER)
        assert states(section)["source"][0] == "ok"
    gone = MetersSection(kind="meters", serial_port="/dev/ttyNOWHERE", meters=METER)
    assert states(gone)["source"] == ("fail", "/dev/ttyNOWHERE does not exist")


def test_missing_libraries_are_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    found = states(EthercatSection(kind="ethercat", interface="lo"))
    assert found["source libraries"] == ("fail", "pysoem not installed")


@pytest.mark.parametrize("section", [SimulatedSection()])
def test_a_simulated_source_needs_nothing(section):
    assert states(section) == {}
