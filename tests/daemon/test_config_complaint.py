"""Patterns of keys are said in words."""

from __future__ import annotations

import pytest

from acqd.daemon.config import Config
from acqd.daemon.config_complaint import PATTERNS
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
