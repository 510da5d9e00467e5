"""Mistakes on the command line: one line, exit code 2, without a frame around it."""

from __future__ import annotations

import pytest

from acqd.cli.commands import command_tree
from acqd.cli.main import for_people
from acqd.daemon.config_file import load_config
from acqd.errors import UserError
from acqd.telemetry.ports import bare_host
from tests.commands import acqd_here, refused

MISTAKES = {
    (
        "jitter",
        "--duration",
        "-3",
    ): "jitter: --duration: expected a number greater than or equal to 0.5; see acqd jitter --help",
    ("jitter", "--seconds", "3"): "jitter: no such option: --seconds (did you mean --duration?); see acqd jitter",
    ("capture", "--output", "a"): "capture: no such option: --output (did you mean --out?); see acqd capture",
    ("robot", "check", "--robot", "a"): "robot check: no such option: --robot; see acqd robot check",
    ("capture", "--outt", "a"): "capture: no such option: --outt (did you mean --out?); see acqd capture",
    ("plan", "3", "--days", "1", "--days", "2"): "plan: --days is given more than once; leave one of them",
    ("service", "install", "--broker", "--no-broker"): "service install: --broker or --no-broker is given more than",
    ("alarms", "--port", "1", "--port", "2", "list"): "alarms: --port is given more than once; leave one of them",
    ("doctor", "--wiring", "--power", "nan"): "doctor: --power: expected a number",
    ("sink", "--group", "a/+"): "sink: --group: expected a name without blanks, / + and #",
    ("watch", "--host", ""): "watch: --host: expected a name or an address without blanks",
    ("watch", "--host", "a b"): "watch: --host: expected a name or an address without blanks",
    ("plan", "many"): "plan: N: expected a whole number; see acqd plan --help",
    ("plan", "3", "4"): "plan: unexpected extra argument(s) (4); see acqd plan --help",
    ("energy", "--bye", "day"): "energy: no such option: --bye",
    ("plan", "-5"): "plan: -5: expected a number that is not negative",
    ("energy", "--by"): "energy: --by: expected an argument after the option; see acqd energy --help",
    ("sink", "quarantine", "list", "--limit"): "sink quarantine list: ",
    ("replay", "--mode", "square", "x.npz"): "replay: --mode: 'square': expected 'synchronous', 'fixed'; see acqd rep",
    ("archive", "verify", "--config"): "archive verify: --config: expected an argument after the option; see acqd a",
    ("train", "ds", "--seed", "-1"): "train: --seed: expected a number greater than or equal to 0; see acqd train",
    ("train",): "train: missing argument 'DS'; see acqd train --help",
    ("completeness",): "no such command 'completeness' (did you mean 'acqd sink completeness'?); see acqd --help",
    ("archive", "nosuch"): "archive: no such command 'nosuch'; see acqd archive --help",
    ("energi",): "no such command 'energi' (did you mean 'energy'",
}


@pytest.mark.parametrize("words", MISTAKES)
def test_a_command_line_that_cannot_be_understood_is_answered_in_one_line(words, capfd):
    with pytest.raises(SystemExit) as end:
        for_people(lambda: command_tree(words)(list(words), prog_name="acqd", standalone_mode=False))
    said = capfd.readouterr().err
    assert end.value.code == 2 and said.startswith(f"acqd: {MISTAKES[words]}") and said.count("\n") == 1


def test_a_group_without_a_command_shows_its_help(capfd):
    with pytest.raises(SystemExit) as end:
        for_people(lambda: command_tree(["archive"])(["archive"], prog_name="acqd", standalone_mode=False))
    assert end.value.code == 2 and "verify" in "".join(capfd.readouterr())


@pytest.mark.parametrize("host", ["mqtt://broker:1883", "broker:1883", "https://user@broker/path"])
def test_a_host_is_a_name_without_scheme_and_port(host, tmp_path, capfd):
    with pytest.raises(SystemExit) as end:
        for_people(lambda: command_tree(["watch"])(["watch", "--host", host], prog_name="acqd", standalone_mode=False))
    said = "expected a name or an address alone, such as broker"
    assert end.value.code == 2 and f"acqd: watch: --host: {said}" in capfd.readouterr().err
    (tmp_path / "a.toml").write_text(f'[mqtt]\nhost = "{host}"\n')
    with pytest.raises(UserError, match=f"mqtt.host: {said}"):
        load_config(tmp_path / "a.toml")


@pytest.mark.parametrize("host", ["::1", "fe80::1%eth0", "fe80::1", "broker.hall-3.example.", "10.0.0.5"])
def test_an_address_is_a_host(host):
    assert bare_host(host) == host


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("bridge", "homeassistant", "--once", "--remove"), "give one"),
        (("bridge", "homeassistant", "--device", "a"), "--device is for --remove"),
        (
            ("en50160", "--declared-voltage", "230", "--from", "2026-11-01", "--to", "2026-11-08", "--days", "3"),
            "leave",
        ),
    ],
)
def test_options_that_contradict_each_other_are_refused(words, said, tmp_path):
    assert said in refused(acqd_here(*words, cwd=tmp_path))


def test_a_plant_without_its_broker_is_told_how_to_do_without(tmp_path):
    (tmp_path / "acqd.toml").write_text('[mqtt]\nhost = "broker.invalid"\n')
    said = refused(acqd_here("plant", "page", "--config", "acqd.toml", cwd=tmp_path))
    assert "broker.invalid" in said and said.endswith("--no-broker leaves states and alarms out")


def test_a_service_without_a_port_is_not_forgotten(tmp_path):
    (tmp_path / "acqd.toml").write_text("[health]\nport = 0\nsink_port = 9\n")
    done = acqd_here("status", cwd=tmp_path)
    assert done.returncode == 1 and "daemon is not asked: [health] port is 0" in done.stderr


def test_a_switch_that_can_only_be_on_may_stand_twice_as_an_alias_leaves_it(tmp_path):
    done = acqd_here("config", "check", "none.toml", "--json", "--json", cwd=tmp_path)
    assert done.returncode == 2 and "none.toml" in done.stderr and "more than once" not in done.stderr
