"""acqd.toml: the shipped file is true and complete, mistakes are named."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

import pytest
from pydantic import BaseModel

from acqd.daemon.config import Config
from acqd.daemon.config_complaint import known_keys
from acqd.daemon.config_file import load_config
from acqd.daemon.device_section import WaveformKeys
from acqd.daemon.source_sections import SECTIONS
from acqd.errors import InputError
from tests.places import ROOT

SHIPPED = ROOT / "config" / "acqd.toml"


def blocks() -> dict[str, str]:
    """Each commented [source] block of the shipped file as text without its comment signs."""
    found = {}
    for text in re.split(r"\n(?=# \[source\])", SHIPPED.read_text())[1:]:
        lines = [line[2:].removeprefix("# ") for line in text.split("\n\n")[0].splitlines() if line.startswith("# ")]
        kind = next(line.split('"')[1] for line in lines if line.startswith("kind"))
        found[kind] = "\n".join(lines)
    return found


def keys(section: dict[str, object], prefix: str) -> set[str]:
    return {f"{prefix}.{key}" for key in section}


def test_the_shipped_file_is_all_defaults():
    assert load_config(SHIPPED).model_dump() == Config().model_dump()


def test_the_shipped_file_has_every_key_of_every_kind():
    uncommented = "\n".join(
        line.removeprefix("# ") if line.startswith("# ") and " = " in line.split("#")[1] else line
        for line in re.sub(r"(?ms)^# For another kind.*?(?=^\[metering\])", "", SHIPPED.read_text()).splitlines()
    )
    found = set()
    for name, value in tomllib.loads(uncommented).items():
        found |= keys(value, name) if isinstance(value, dict) else {name}
    for text in blocks().values():
        found |= keys(tomllib.loads(text)["source"], "source")
    assert found == set(known_keys())


@pytest.mark.parametrize("kind", list(blocks()))
def test_each_block_can_be_taken_as_it_is_and_shows_the_defaults(kind, tmp_path):
    text = blocks()[kind]
    if kind in ("modbus", "meters"):  # host or serial_port, not both
        text = re.sub(r"(?m)^serial_port.*$" if kind == "modbus" else r"(?m)^host.*$", "", text)
    (tmp_path / "c.toml").write_text(text)
    source = load_config(tmp_path / "c.toml").source
    assert source.kind == kind
    shown = tomllib.loads(blocks()[kind])["source"]
    for name, field in type(source).model_fields.items():
        shown_once = name in WaveformKeys.model_fields  # in the first block, for every kind
        default = None if shown_once or field.is_required() else field.default
        if default is not None and not isinstance(default, BaseModel):
            assert shown[name] == field.default, f"{name} is shown with another value than its default"


def test_every_kind_has_its_block():
    assert set(blocks()) | {"simulated"} == {
        section.model_fields["kind"].annotation.__args__[0] for section in SECTIONS
    }


MISTAKES = {
    "[metring]\n": "unknown key metring; did you mean metering?",
    "[sorce]\n": "unknown key sorce; did you mean source?",
    "[[box]]\ndevice = 'a'\n": "unknown key box; acqd config init writes a file with every key",
    "port = 1884\n": "unknown key port; did you mean source.port or mqtt.port or",
    "[source]\npower_factor = true\n": "source.power_factor: expected a number (got true)",
    "[source]\nvoltage = '230'\n": "source.voltage: expected a number (got '230')",
    "[source]\nphases = 2.0\n": "source.phases: expected a whole number (got 2.0)",
    "[events]\nenabled = 'no'\n": "events.enabled: expected a boolean (got 'no')",
    "[source.harmonics]\n5 = true\n": "source.harmonics.5: expected a number (got true)",
    "[metering]\nmod = 'fixed'\n": "unknown key metering.mod; did you mean metering.mode",
    "[metering]\nmode = 'sync'\n": "metering.mode",
    "[mqtt]\nport = 99999\n": "mqtt.port",
    "device = 'a b'\n": "device",
    "device = '..'\n": "device",
    "state_dir = 'a\\u0000b'\n".replace("'", '"'): "state_dir: holds a NUL character",
    '[sink]\nclient_id = "a\\u0000"\n': "sink.client_id: holds a NUL character",
    '[sink]\nclient_id = "a\\u0001b"\n': "sink.client_id: holds a character that cannot be printed",
    '[sink]\ngroup = "a\\u007f"\n': "sink.group: holds a character that cannot be printed",
    '[mqtt]\nusername = "a\\n"\n': "mqtt.username: holds a character that cannot be printed",
    '[mqtt.web]\nusername = "a\\uFFFF"\n': "mqtt.web.username: holds a character that cannot be printed",
    '[sink]\ndatabase = "a\\u0000.sqlite"\n': "sink.database: holds a NUL character",
    '[mqtt]\nhost = "a\\u0000"\n': "mqtt.host: holds a NUL character",
    f"[mqtt]\nusername = '{'x' * 65_536}'\n": "mqtt.username: is longer than 65535 bytes",
    f"[sink]\nclient_id = '{'x' * 65_536}'\n": "sink.client_id: is longer than 65535 bytes",
    "state_dir = '~nobody-of-this-name/a'\n": "state_dir: names the home of an unknown user",
    "[source\n": "not valid TOML",
    "[source]\nkind = 'replay'\n": "source.file is missing",
    "[source]\nkind = 'profinet'\n": "source.kind: 'profinet' is unknown, expected one of simulated, replay",
    "[source]\nkind = 'ethercat'\n": "source.interface is missing",
    "[source]\nkind = 'ads'\nhost = 'h'\nams_net_id = '1.2.3.4.1.1'\nseed = 3\n": "seed belongs to kind simulated",
    "[source]\nloops = 3\n": "source.loops belongs to kind replay, here kind is simulated",
    "[source]\nkind = 'ethercat'\ninterface = 'e'\noversampling = 21\n": "source.oversampling",
    "[source]\nkind = 'ethercat'\ninterfaces = 'e'\n": "source.interface",
    "[source]\nkind = 'ads'\nhost = 'h'\nams_net_id = '1.2.3'\n": "source.ams_net_id",
    "[source]\nkind = 'modbus'\n": "either host (Modbus TCP) or serial_port (Modbus RTU, ASCII)",
    "[source]\nkind = 'sampled-values'\ninterface = 'e'\nchannels = [1, 2, 3]\n": "channels",
    "[source]\nkind = 'meters'\nhost = 'h'\nmeters = []\n": "source.meters",
    "[source]\nkind = 'meters'\nhost = 'h'\n[[source.meters]]\nname = 'm'\n": "source.meters.0.profile is missing",
}


def test_a_path_may_begin_with_the_home_of_the_user(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    file = tmp_path / "acqd.toml"
    file.write_text('state_dir = "~/acqd"\n')
    assert load_config(file).state_dir == tmp_path / "acqd"


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_are_named_in_one_line(text, tmp_path):
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_config(path)
    assert MISTAKES[text] in str(caught.value) and "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_replay_takes_map_scales_and_rate(tmp_path):
    (tmp_path / "c.toml").write_text(
        "[source]\nkind = 'replay'\nfile = 'a.csv'\nmap = 'u1=A,i1=B'\nu_scale = 200\nrate = 10000\nf_nominal = 60\n"
    )
    config = load_config(tmp_path / "c.toml")
    channels = config.source.spec()["channels"]
    assert channels["columns"] == {"u1": "A", "i1": "B"} and channels["u_scale"] == 200 and channels["rate"] == 10_000
    assert config.window == 0.05


def test_a_new_integration_brings_its_table(tmp_path):
    """No file of the daemon names an integration."""
    (tmp_path / "doors").mkdir()
    (tmp_path / "doors" / "__init__.py").touch()
    (tmp_path / "doors" / "section.py").write_text(
        "from acqd.section import Section\n\n\nclass Doors(Section):\n    open_s: float = 5.0\n\n\n"
        'TABLES = {"doors": Doors}\n'
    )
    (tmp_path / "c.toml").write_text("[doors]\nopen_s = 2.5\n")
    (tmp_path / "wrong.toml").write_text("[doors]\nopen = 2.5\n")
    code = f"""
from pathlib import Path
import acqd.integrations
acqd.integrations.__path__.append({str(tmp_path)!r})
from acqd.daemon.config import Config
from acqd.daemon.config_file import load_config
from acqd.integrations.doors.section import Doors
print(load_config(Path("c.toml")).table(Doors).open_s, Config().table(Doors).open_s)
try:
    load_config(Path("wrong.toml"))
except ValueError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[0] == "2.5 5.0", done.stderr
    assert "unknown key doors.open; did you mean doors.open_s?" in done.stdout + done.stderr
