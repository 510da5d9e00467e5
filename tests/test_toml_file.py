"""TOML that people have written: mistakes are named by line and key, and no value is repeated."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.errors import InputError
from acqd.toml_file import tables_of
from tests.commands import acqd_here, refused

MISTAKES = {
    'device = "a"\ndevice = "b"\n': "line 2: device is there already; leave one of the two",
    "a = 1\na = 2": "line 2: a is there already; leave one of the two",
    "[mqtt]\nport = 1\n[mqtt]\nport = 2\n": "line 3: [mqtt] is there already; leave one of the two",
    "[source]\n[[source]]\n": "line 2: [[source]] is there already; leave one of the two",
    "[mqtt]\nhost = localhost\n": "line 2: host: expected text in quotes, a number such as 0.5, true, false",
    '{"mqtt": {"port": 1}}': "line 1: expected key = value, or [section]",
    "mqtt:\n  port: 1\n": "line 1: expected key = value, or [section]",
    f"port = {'9' * 6000}": "a number has too many digits",
    f"a = {'[' * 5000}": "lists or tables are nested too deeply",
    '[mqtt]\nhost = "127.0.0.1\nport = 1883\n': "line 2: host: the closing quote is missing",
    "price = 0,30\n": "line 1: price: expected one value a line, numbers with a point and without a unit",
    "[sink]\nkeep_days = 30 d\n": "line 2: keep_days: expected one value a line",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_is_named_by_its_line_and_key(text, tmp_path):
    (path := tmp_path / "x.toml").write_text(text)
    with pytest.raises(InputError) as error:
        tables_of(path)
    assert f"x.toml: is not valid TOML: {MISTAKES[text]}" in str(error.value)
    assert "tuple" not in str(error.value) and "('" not in str(error.value)


def test_what_cannot_be_a_configuration_is_refused_soon(tmp_path):
    (path := tmp_path / "x.toml").write_bytes(b"#" * 4_000_001)
    with pytest.raises(InputError, match=r"x.toml: is larger than 4 MB; expected a file of TOML"):
        tables_of(path)
    path.write_text("device = 'a'", encoding="utf-16")
    with pytest.raises(InputError, match="no UTF-8 text"):
        tables_of(path)


@given(st.text(max_size=60))
def test_no_message_repeats_a_value(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("toml") / "x.toml"
    path.write_text(f"{text}\npassword = 'correct-horse'\npassword = 'battery-staple'\n", encoding="utf-8")
    with pytest.raises(InputError) as error:
        tables_of(path)
    assert "correct-horse" not in str(error.value) and "battery-staple" not in str(error.value)


@pytest.mark.parametrize("words", [("config", "check", "x.toml"), ("energy", "--tariff", "x.toml")])
def test_commands_say_it(words, tmp_path):
    (tmp_path / "x.toml").write_text("price = 0.3\nprice = 0.4\n")
    assert "x.toml: is not valid TOML: line 2: price is there already" in refused(acqd_here(*words, cwd=tmp_path))
