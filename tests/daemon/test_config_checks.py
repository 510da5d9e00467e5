"""What `acqd config check` says of files that every key of is right, and that cannot work."""

from __future__ import annotations

import pytest

from acqd.daemon.config_checks import config_checks
from acqd.daemon.config_file import load_config
from acqd.errors import UserError
from tests.commands import acqd_here, refused

CASES = {
    "[health]\nport = 9000\nsink_port = 9000\n": ("ports", "health.port and health.sink_port are both 9000"),
    "[health]\nport = 8731\n": ("ports", "health.port and web.port are both 8731"),
    "[health]\nport = 1883\n": ("ports", "health.port and mqtt.port are both 1883"),
    'state_dir = "file"\n': ("state_dir", "file is a file, not a folder"),
    '[mqtt]\nca_file = "file"\n': ("mqtt", "ca_file file: holds no certificate in PEM"),
    '[mqtt]\ncert_file = "file"\nkey_file = "file"\n': ("mqtt", "no certificate with its key in PEM"),
    '[mqtt]\nca_file = "none.pem"\n': ("mqtt", "ca_file: none.pem cannot be read"),
    '[mqtt]\npassword = "x"\n': ("mqtt", "a password without username"),
    'device = "hall-4"\n[mqtt]\nusername = "hall-3"\npassword = "x"\nsink = { username = "s", password = "y" }\n': (
        "broker user",
        "rows of hall-4 go out as hall-3",
    ),
}
RIGHT = (
    '[health]\nport = 9000\n[web]\nhost = "192.0.2.1"\nport = 9000\n',
    "[health]\nport = 0\nsink_port = 0\n",
    '[mqtt]\nhost = "broker.invalid"\n[health]\nport = 1883\n',
    'device = "hall-3"\n[mqtt]\nusername = "hall-3"\npassword = "x"\nsink = { username = "s", password = "y" }\n',
    '[mqtt]\nusername = "acqd-sink"\npassword = "x"\n',  # the computer of a sink
    'device = "a"\n[mqtt]\nusername = "a"\npassword = "x"\nsink = { username = "s", password = "y" }\n'
    '[[source]]\ndevice = "b"\nkind = "simulated"\n[[source]]\ndevice = "c"\nkind = "simulated"\n',
)


def found(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("hello")
    (path := tmp_path / "acqd.toml").write_text(text)
    return [one for one in config_checks(load_config(path), connect=False) if one.state != "ok"]


@pytest.mark.parametrize("text", CASES)
def test_what_cannot_work_is_named_by_its_key(text, tmp_path, monkeypatch):
    check, said = CASES[text]
    [one] = found(text, tmp_path, monkeypatch)
    assert one.check == check and said in one.finding and one.advice


@pytest.mark.parametrize(
    ("text", "state"),
    [
        ("[health]\nport = 8731\n", "warn"),
        ("[health]\nport = 8731\n[web]\nenabled = true\n", "fail"),
        ("[health]\nport = 4840\n[opcua]\nport = 4840\n", "fail"),
        ("[health]\nport = 1883\n", "fail"),
        ("[health]\nport = 9110\n[web]\nport = 9110\n", "fail"),
    ],
)
def test_a_port_of_a_service_that_the_file_does_not_name_may_be_shared(text, state, tmp_path, monkeypatch):
    assert [one.state for one in found(text, tmp_path, monkeypatch)] == [state]


@pytest.mark.parametrize("text", RIGHT)
def test_what_can_work_is_right(text, tmp_path, monkeypatch):
    assert found(text, tmp_path, monkeypatch) == []


def test_missing_credentials_name_the_file_of_the_user_and_what_makes_it(monkeypatch):
    from acqd.daemon.mqtt_section import MqttSection

    monkeypatch.delenv("CREDENTIALS_DIRECTORY", raising=False)
    section = MqttSection(username="acqd-bridge", password_file="$CREDENTIALS_DIRECTORY/mqtt.password")
    with pytest.raises(UserError, match=r"root reads /etc/acqd/acqd-bridge.password; acqd service install makes it"):
        section.address()


def test_a_folder_in_the_place_of_the_database_is_called_so(tmp_path):
    (tmp_path / "d").mkdir()
    (tmp_path / "a.toml").write_text('[sink]\ndatabase = "d"\n[mqtt]\nenabled = false\n')
    done = acqd_here("config", "check", "a.toml", "--connect", "--json", cwd=tmp_path)
    assert done.returncode == 1 and "d: is a folder; expected a file, such as d/acqd.sqlite" in done.stdout


@pytest.mark.parametrize("command", [("sink", "completeness"), ("plant", "page", "--no-broker")])
def test_a_damaged_database_is_answered_with_the_way_back(command, tmp_path):
    (tmp_path / "x.sqlite").write_bytes(b"SQLite format 3\0" + bytes(84) + b"\x0d" * 4000)
    said = refused(acqd_here(*command, "--database", "x.sqlite", cwd=tmp_path))
    assert "x.sqlite" in said and any(word in said for word in ("acqd service restore", "another program's file"))
