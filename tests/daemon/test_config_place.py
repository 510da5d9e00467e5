"""Commands find the configuration by themselves, and an installed one works by hand."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from acqd.daemon import config_place
from acqd.daemon.config_file import load_config
from acqd.errors import UserError
from acqd.storage.database import open_database
from acqd.telemetry.broker import free_port
from tests.commands import acqd_here, refused


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """What `acqd service install --root` leaves, as the file that commands find last."""
    folder = tmp_path / "root/etc/acqd"
    folder.mkdir(parents=True)
    (tmp_path / "root/var/lib/acqd").mkdir(parents=True)
    (folder / "hall-3.password").write_text("right\n")
    (folder / "acqd.toml").write_text(
        f'device = "hall-3"\n[health]\nport = {free_port()}\nsink_port = 0\n'
        '[mqtt]\nusername = "hall-3"\npassword_file = "$CREDENTIALS_DIRECTORY/mqtt.password"\n'
    )
    monkeypatch.setattr(config_place, "PLACES", (Path("acqd.toml"), folder / "acqd.toml"))
    return folder / "acqd.toml"


def test_an_installed_file_has_the_folder_and_the_password_of_its_unit(installed, monkeypatch):
    config = load_config(installed)
    state = installed.parents[2] / "var/lib/acqd"
    assert config.state_dir == state and config.sink.database == str(state / "acqd.sqlite")
    assert config.mqtt.address().password == "right"
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/other")  # a unit passes both
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", "/run/credentials")
    config = load_config(installed)
    assert config.sink.database == "acqd.sqlite" and str(config.mqtt.password_file).startswith("$")
    assert str(config.state_dir) == "/var/lib/other"


def test_files_of_services_are_in_the_folder_where_units_work(installed, monkeypatch):
    installed.write_text(
        installed.read_text() + '[marks]\nfile = "m/marks.csv"\n[alarms]\nstate = "/srv/alarms.json"\n'
    )
    config, state = load_config(installed), installed.parents[2] / "var/lib/acqd"
    assert (config.marks.file, config.alarms.state) == (state / "m/marks.csv", Path("/srv/alarms.json"))
    monkeypatch.setenv("STATE_DIRECTORY", str(state))  # of a unit, which works there
    assert load_config(installed).marks.file == Path("m/marks.csv")


def test_every_service_logs_in_with_its_user(installed, caplog):
    text = installed.read_text()
    users = 'sink = { username = "acqd-sink" }\nweb = { username = "viewer", password = "plain" }\n'
    installed.write_text(text + users)
    for name in ("acqd-sink", "mqtt"):
        (installed.parent / f"{name}.password").write_text(f"of {name}\n")
    logins = {name: load_config(installed, name).mqtt.address() for name in ("daemon", "sink", "web", "bridge")}
    assert {name: (one.username, one.password) for name, one in logins.items()} == {
        "daemon": ("hall-3", "right"), "sink": ("acqd-sink", "of acqd-sink"), "web": ("viewer", "plain"),
        "bridge": ("hall-3", "right"),
    }  # fmt: skip
    (installed.parent / "acqd-sink.password").unlink()  # not installed here: the daemon's password is no substitute
    (installed.parent / "mqtt.password").unlink()
    config = load_config(installed)
    assert config.mqtt.without_password == ["sink"]
    with pytest.raises(UserError, match="no credentials here"):
        config.mqtt.of("sink").address()
    (installed.parent / "sink.toml").write_text(text)
    load_config(installed.parent / "sink.toml")
    assert "sink.toml is of an earlier version: acqd config upgrade" in caplog.text


def test_commands_find_the_configuration_and_say_which(installed, tmp_path):
    open_database(str(installed.parents[2] / "var/lib/acqd/acqd.sqlite"))
    done = acqd_here("sink", "completeness", cwd=tmp_path)
    assert "is it the right one" in done.stderr and f"acqd: configuration: {installed}" in done.stderr
    (tmp_path / "acqd.toml").write_text('[sink]\ndatabase = "here.sqlite"\n')
    done = acqd_here("sink", "completeness", cwd=tmp_path)
    assert "here.sqlite" in done.stderr and f"acqd: configuration: {tmp_path / 'acqd.toml'}" in done.stderr
    done = acqd_here("sink", "completeness", "--config", installed, cwd=tmp_path)
    assert "acqd: configuration" not in done.stderr


def test_a_broker_of_the_command_line_gets_no_password_of_a_file_that_was_found(installed, tmp_path):
    from acqd.cli.options import configured

    assert configured(None, "elsewhere.example", None).mqtt.address().password is None


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read_is_named(installed, tmp_path):
    installed.chmod(0)
    assert "may not read it" in refused(acqd_here("archive", "list", cwd=tmp_path))
