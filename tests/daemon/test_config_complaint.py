"""Patterns of keys are said in words."""

from __future__ import annotations

import re

import pytest

from acqd.daemon.config import Config
from acqd.daemon.config_complaint import PATTERNS, known_keys
from acqd.daemon.config_file import load_config
from acqd.errors import UserError
from tests.commands import acqd_here, refused


def patterns(schema):
    if isinstance(schema, dict):
        yield from [schema["pattern"]] if isinstance(schema.get("pattern"), str) else []
        schema = list(schema.values())
    if isinstance(schema, list):
        for one in schema:
            yield from patterns(one)


def test_every_pattern_of_the_configuration_has_words():
    used = set(patterns(Config.model_json_schema()))
    assert len(used) > 5 and used <= set(PATTERNS)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[alarms]\nmail_to = ["nobody"]\n', "alarms.mail_to.0: expected a mail address like ada@example.org"),
        ('[alarms]\nwebhooks = ["hook.invalid"]\n', "expected an address that begins with http:// or https://"),
        ('[sparkplug]\ngroup = "a b"\n', "sparkplug.group: expected 1 to 64 letters without blanks"),
        ('[source]\nkind = "ads"\nhost = "a"\nams_net_id = "1.2"\n', "expected six numbers like 5.12.34.56.1.1"),
        ('[energy]\nzone = "Mitteleuropa"\n', "zone 'Mitteleuropa' is unknown; expected a name like Europe/Berlin"),
        ('[energy]\ntariff = "t.toml"\n', "t.toml: price: expected a number"),
    ],
)
def test_a_check_says_what_a_key_wants(text, said, tmp_path):
    (tmp_path / "t.toml").write_text('price = "x"\n')
    (tmp_path / "a.toml").write_text(text)
    done = acqd_here("config", "check", "a.toml", "--json", cwd=tmp_path)
    assert done.returncode in (1, 2) and said in done.stdout + done.stderr
    if done.returncode == 2:
        assert said in refused(done)


VALUES = ("'x y/#'", "''", "-1", "nan", "inf", "1e400", "[]", "[[]]", "{}", "{a=1}", "true", "2026-01-01", "12:00:00",
          "99999999999999999999", '"\\u0000"', "'ü'", f"'{'a' * 300}'")  # fmt: skip


@pytest.mark.parametrize("section", sorted({key.partition(".")[0] for key in known_keys()}))
def test_a_wrong_value_of_any_key_is_one_line_in_our_words(section, tmp_path):
    """Wrong types, units, dates, names: taken, or refused with file, key and what was expected."""
    path, refusals = tmp_path / "a.toml", 0
    for key in [key for key in known_keys() if key.partition(".")[0] == section]:
        table, _, name = key.rpartition(".")
        for value in VALUES:
            path.write_text(f"[{table}]\n{name} = {value}\n" if table else f"{name} = {value}\n", encoding="utf-8")
            try:
                load_config(path)
            except UserError as error:
                said, refusals = str(error), refusals + 1
                assert said.startswith(f"{path}: ") and section in said and "\n" not in said
                assert not re.search(r"Input |String should|<class|Unable to parse|match pattern|Errno", said), said
    assert refusals


@pytest.mark.parametrize("key", ["state_dir", "sink.database", "energy.tariff", "mqtt.ca_file"])
def test_an_empty_path_is_no_path(key, tmp_path):
    (path := tmp_path / "a.toml").write_text(f'{key} = ""\n')
    with pytest.raises(UserError, match=f"{key}: expected (a path; leave the key out|at least 1 character)"):
        load_config(path)
