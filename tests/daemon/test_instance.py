"""Who a daemon is."""

from __future__ import annotations

import re
import socket

import pytest

from acqd.daemon.config import Config
from acqd.daemon.instance import claimant, instance_id, name_of_host
from acqd.telemetry.topics import valid_device


def test_an_installation_keeps_its_id_and_a_run_has_a_boot(tmp_path):
    first = instance_id(tmp_path)
    assert re.fullmatch("[0-9a-f]{12}", first) and instance_id(tmp_path) == first
    assert instance_id(None) != instance_id(None)
    (tmp_path / "instance").write_bytes(b"\xff torn")
    assert instance_id(tmp_path) not in (first, "") and instance_id(tmp_path) == instance_id(tmp_path)
    me = claimant(tmp_path, "b00t", take_name=True)
    assert (me.instance, me.boot, me.host, me.taken) == (instance_id(tmp_path), "b00t", socket.gethostname(), True)


@pytest.mark.parametrize(
    ("host", "name"),
    [
        ("press-7.plant.example", "acqd-press-7"),
        ("Zelle_ü", "acqd-Zelle"),
        ("", "acqd"),
        ("x" * 64, "acqd-xxx"),
    ],
)
def test_a_run_without_a_configuration_is_named_after_its_host(monkeypatch, host, name):
    monkeypatch.setattr(socket, "gethostname", lambda: host)
    assert name_of_host().startswith(name) and valid_device(name_of_host())
    assert Config.demonstration(1883).device == name_of_host() and Config().device == "acqd"
