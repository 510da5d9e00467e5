"""Who a daemon is."""

from __future__ import annotations

import os
import re
import socket

import pytest

from acqd.daemon.config import Config
from acqd.daemon.instance import claimant, instance_id, name_of_host
from acqd.daemon.service import Service
from acqd.telemetry.ports import free_port
from acqd.telemetry.topics import valid_device


def test_an_installation_keeps_its_id_and_a_run_has_a_boot(tmp_path):
    first = instance_id(tmp_path)
    assert re.fullmatch("[0-9a-f]{12}", first) and instance_id(tmp_path) == first
    assert instance_id(None) != instance_id(None)
    (tmp_path / "instance").write_bytes(b"\xff torn")
    assert instance_id(tmp_path) not in (first, "") and instance_id(tmp_path) == instance_id(tmp_path)
    me = claimant(tmp_path, "b00t", take_name=True)
    assert (me.instance, me.boot, me.host, me.taken) == (instance_id(tmp_path), "b00t", socket.gethostname(), True)


def test_the_folder_of_a_daemon_is_not_for_everybody(tmp_path):
    """Outside of systemd, which gives it the mode of the unit, the umask of a shell would open it."""
    before, folder = os.umask(0o022), tmp_path / "new" / "state"
    try:
        config = Config.demonstration(free_port()).model_copy(update={"state_dir": folder})
        Service(config.model_copy(update={"mqtt": config.mqtt.model_copy(update={"enabled": False})}))
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o750


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
