"""`acqd config check, diff, upgrade`: files of earlier versions become one, and nothing is lost on the way."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from acqd.daemon.config_checks import config_checks
from acqd.daemon.config_file import load_config
from acqd.installation.plan import LOGINS, configuration
from acqd.integrations.alarms.section import AlarmsSection
from tests.commands import acqd_here, refused
from tests.installation.roots import NEEDS, contents, installed

MQTT = '[mqtt]\nhost = "10.0.0.5"\nusername = "{user}"\npassword_file = "$CREDENTIALS_DIRECTORY/mqtt.password"\n'


@pytest.fixture
def five(tmp_path):
    """The files that an earlier version installed; the broker was entered in acqd.toml only."""
    folder = tmp_path / "etc/acqd"
    folder.mkdir(parents=True)
    users = {"acqd": "hall-3"} | {name: user for name, user in LOGINS.items() if name != "operator"}
    for name, user in users.items():
        (folder / f"{name}.toml").write_text(
            f'# file of {name}\ndevice = "hall-3"  # the press\n' + MQTT.format(user=user).replace(
                "10.0.0.5", "10.0.0.5" if name == "acqd" else "127.0.0.1")
        )  # fmt: skip
        (folder / f"{user}.password").write_text(f"{user}'s\n")
    return folder


def appended(path, text):
    path.write_text(path.read_text() + text)


def test_five_files_become_one_that_every_service_reads(five):
    appended(five / "sink.toml", "[sink]\nkeep_days = 90.0\n")
    appended(five / "web.toml", '[web]\ntoken = "secret of the page"\n')
    appended(five / "bridge.toml", '[alarms]\nmail_to = ["ada@example.com"]\n[web]\nport = 1\n')
    before = {path.name: path.read_text() for path in five.glob("*.toml")}
    planned = acqd_here("config", "upgrade", five / "acqd.toml", "--dry-run")
    assert {path.name: path.read_text() for path in five.glob("*.toml")} == before
    assert "+keep_days = 90.0" in planned.stdout
    assert "'10.0.0.5' now holds for the services of sink.toml" in planned.stdout
    done = acqd_here("config", "upgrade", five / "acqd.toml")
    assert done.returncode == 0 and "bridge.toml: web.port = 1 had no effect" in done.stdout
    assert "secret of the page" not in done.stdout
    text = (five / "acqd.toml").read_text()
    assert text.startswith(before["acqd.toml"][:40]) and "# the press" in text
    for name, user in LOGINS.items():
        if name != "operator":  # units of the earlier version name these files
            config = load_config(five / f"{name}.toml", name)
            assert config.mqtt.address().password == f"{user}'s" and config.mqtt.host == "10.0.0.5"
    assert (config.sink.keep_days, config.web.port) == (90.0, 8731)
    assert config.table(AlarmsSection).mail_to == ["ada@example.com"]
    backups = {path.name.partition(".toml")[0]: path.read_text() for path in five.glob("*.toml.2*")}
    assert backups == {name.removesuffix(".toml"): content for name, content in before.items()}
    assert "nothing to do" in acqd_here("config", "upgrade", five / "acqd.toml").stdout


def test_files_that_contradict_each_other_are_refused_and_stay(five):
    sink = five / "sink.toml"
    sink.write_text(sink.read_text().replace("127.0.0.1", "10.0.0.9"))
    before = {path.name: path.read_text() for path in five.iterdir()}
    why = refused(acqd_here("config", "upgrade", five / "acqd.toml"))
    assert "mqtt.host is '10.0.0.5', and '10.0.0.9' in sink.toml" in why
    assert {path.name: path.read_text() for path in five.iterdir()} == before
    assert "unknown key sinc" in _refused_with(five / "web.toml", "[sinc]\n", five)


def _refused_with(path, text, folder):
    appended(path, text)
    return refused(acqd_here("config", "upgrade", folder / "acqd.toml"))


def test_keys_without_effect_go_and_comments_stay(tmp_path):
    file = tmp_path / "acqd.toml"
    file.write_text('# mine\n[source]\nkind = "simulated"\nloops = 1\npower = 90.0  # W\n[mqtt]\nqueue = 500\n')
    done = acqd_here("config", "upgrade", "--json", cwd=tmp_path)
    assert json.loads(done.stdout)["changed"] and "acqd: configuration" in done.stderr
    assert file.read_text() == '# mine\n[source]\nkind = "simulated"\npower = 90.0  # W\n[mqtt]\n'


def test_keys_with_dots_are_rewritten_too(five):
    dotted = 'mqtt.host = "10.0.0.5"\nmqtt.queue = 500\nmqtt.username = "hall-3"\ndevice = "hall-3"\n'
    (five / "acqd.toml").write_text(dotted + 'mqtt.password_file = "$CREDENTIALS_DIRECTORY/mqtt.password"\n')
    done = acqd_here("config", "upgrade", five / "acqd.toml")
    assert done.returncode == 0, done.stderr
    assert "queue" not in (five / "acqd.toml").read_text()
    assert load_config(five / "acqd.toml", "sink").mqtt.username == "acqd-sink"


def test_diff_names_what_differs_and_no_secret(five, tmp_path):
    appended(five / "acqd.toml", 'port = 1884\n[web]\ntoken = "abc"\n')
    other = tmp_path / "other.toml"
    other.write_text('[source]\nkind = "ads"\nhost = "h"\nams_net_id = "1.2.3.4.5.6"\n')
    told = acqd_here("config", "diff", five / "acqd.toml").stdout
    assert "'hall-3'" in told and "1884" in told and "abc" not in told and "source.power" not in told
    keys = {one["key"] for one in json.loads(acqd_here("config", "diff", five / "acqd.toml", other, "--json").stdout)}
    assert {"source.kind", "source.ams_net_id", "mqtt.port"} <= keys
    assert "nothing differs" in acqd_here("config", "diff", other, other).stdout
    by_option = acqd_here("config", "diff", "--config", five / "acqd.toml", other, "--json")
    assert {one["key"] for one in json.loads(by_option.stdout)} == keys and str(other) in by_option.stdout
    assert "one file" in acqd_here("config", "diff", "--config", other, other, other).stderr


def test_check_names_passwords_and_folders_that_are_not_there(five):
    assert acqd_here("config", "upgrade", five / "acqd.toml").returncode == 0
    assert acqd_here("config", "check", five / "acqd.toml").returncode == 0
    (five / "acqd-sidecar.password").unlink()  # not installed here: no fault
    appended(five / "acqd.toml", '[archive]\nenabled = true\nfolder = "/nowhere"\n')
    done = acqd_here("config", "check", five / "acqd.toml", "--json")
    found = {one["check"]: (one["state"], one["finding"]) for one in json.loads(done.stdout)}
    assert done.returncode == 1 and found["archive.folder"] == ("fail", "/nowhere does not exist")
    assert found["mqtt.sink"][0] == found["mqtt.sidecar"][0] == "ok" and "not installed" in found["mqtt.sidecar"][1]
    (five / "hall-3.password").unlink()
    assert "password" in acqd_here("config", "check", five / "acqd.toml").stdout
    assert "unknown key devise" in _check_of(five, 'devise = "a"\n')


@pytest.mark.parametrize(
    ("text", "check"),
    [
        ('[source]\nkind = "replay"\nfile = "nosuch.csv"\n', "source.file"),
        ('[source]\nload_profile = "nosuch.csv"\n', "source.load_profile"),
        ('[[source]]\nkind = "replay"\ndevice = "a"\nfile = "nosuch.csv"\n', "source of a.file"),
    ],
)
def test_check_names_the_key_of_a_file_that_is_not_there(tmp_path, text, check, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("acqd.toml").write_text(text)
    Path("nosuch.csv").write_text("t,P1\n0,1\n")
    states = [{one.check: one for one in config_checks(load_config(Path("acqd.toml")), connect=False)}]
    Path("nosuch.csv").unlink()
    states.append({one.check: one for one in config_checks(load_config(Path("acqd.toml")), connect=False)})
    assert [found[check].state for found in states] == ["ok", "fail"]
    assert states[1][check].finding == f"{tmp_path}/nosuch.csv does not exist"


def _check_of(folder, text):
    (folder / "other.toml").write_text(text)
    return refused(acqd_here("config", "check", folder / "other.toml"))


def test_the_user_of_a_service_needs_a_password_that_is_not_the_daemons(tmp_path):
    file = tmp_path / "acqd.toml"
    file.write_text('[mqtt]\nusername = "a"\npassword = "p"\nsink = { username = "b" }\n')
    assert "sink.username is set without sink.password_file" in refused(acqd_here("config", "check", file))


@pytest.mark.skipif(bool(NEEDS[0].args[0] or NEEDS[1].args[0]), reason="users and owners need root and systemd")
def test_an_installation_of_an_earlier_version_goes_on_and_is_upgraded(root):
    installed(root, "--device", "hall-3", "--with", "daemon", "--with", "sink")
    folder, units = root / "etc/acqd", root / "etc/systemd/system"
    lines = re.sub(r"(?m)^(sink|sidecar|web|bridge|operator) = .*\n", "", (folder / "acqd.toml").read_text())
    (folder / "acqd.toml").write_text(lines)  # the two files and the unit of an earlier version
    (folder / "sink.toml").write_text(lines.replace('username = "hall-3"', 'username = "acqd-sink"'))
    unit = (units / "acqd-sink.service").read_text().replace("acqd.toml", "sink.toml")
    (units / "acqd-sink.service").write_text(unit)
    before = contents(root)
    assert installed(root) == "nothing to do\n" and contents(root) == before
    why = refused(acqd_here("service", "install", "--root", root, "--with", "web"))
    assert "no user of the broker for web: acqd config upgrade" in why
    assert acqd_here("config", "upgrade", folder / "acqd.toml").returncode == 0
    assert (folder / "sink.toml").is_symlink()
    assert load_config(folder / "sink.toml", "sink").mqtt.username == "acqd-sink"
    assert acqd_here("service", "update", "--root", root, "--program", "/bin/true").returncode == 0
    assert "/etc/acqd/acqd.toml" in (units / "acqd-sink.service").read_text() and not (folder / "sink.toml").exists()
    installed(root, "--with", "web")
    assert tomllib.loads((folder / "acqd.toml").read_text())["mqtt"]["web"] == {"username": "viewer"}


def test_a_fresh_configuration_needs_no_upgrade(tmp_path):
    (tmp_path / "acqd.toml").write_text(configuration("box", users=True))
    assert "nothing to do" in acqd_here("config", "upgrade", tmp_path / "acqd.toml").stdout
