"""[mqtt]: TLS where a certificate is named, and no secret in any message."""

from __future__ import annotations

import pytest

from acqd.daemon.config_file import load_config
from acqd.errors import InputError, UserError
from tests.commands import acqd_here

SECRET = "hunter2"


def config_of(tmp_path, text):
    (tmp_path / "c.toml").write_text(text)
    return load_config(tmp_path / "c.toml")


@pytest.mark.parametrize("key", ["ca_file", "cert_file"])
def test_a_certificate_implies_tls(tmp_path, key):
    mqtt = config_of(tmp_path, f'[mqtt]\n{key} = "x.pem"\n').mqtt
    assert mqtt.uses_tls and mqtt.address().tls
    assert str(mqtt.address()).startswith("mqtts:")
    with pytest.raises(UserError, match="TLS for"):
        mqtt.address().tls_context()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('tls = false\nca_file = "x"', "tls is false, but ca_file is set"),
        ('key_file = "x"', "key_file is set without cert_file"),
        ('username = "u"\npassword = "hunter2"\npassword_file = "x"', "delete one of the two"),
        ("password = 42", "mqtt.password: expected a string"),
        ('password = ["hunter2"]', "mqtt.password"),
        ('password = {is = "hunter2"}', "mqtt.password"),
        ("username = true\npassword = 'hunter2'", "mqtt.username"),
        ("password = hunter2", "not valid TOML"),
        ('password = "hunter2', "not valid TOML"),
        ('pasword = "hunter2"', "unknown key mqtt.pasword"),
        ('"hunter 2" = 3\npasword = "hunter2"', "unknown key"),
    ],
)
def test_mistakes_around_a_password_do_not_show_it(tmp_path, text, complaint):
    with pytest.raises(InputError, match=complaint) as caught:
        config_of(tmp_path, f"[mqtt]\n{text}\n")
    text_of_line = str(caught.value).removeprefix(str(tmp_path))
    assert SECRET not in text_of_line and "42" not in text_of_line and "\n" not in text_of_line


@pytest.mark.parametrize("text", [f'mqtt = "{SECRET}"', f'[sink]\ndatabase = ["{SECRET}"]', f'mqtt = ["{SECRET}"]'])
def test_a_secret_in_the_place_of_a_section_is_not_shown(tmp_path, text):
    with pytest.raises(InputError) as caught:
        config_of(tmp_path, text)
    assert SECRET not in str(caught.value)


def test_a_password_in_the_place_of_its_file_is_not_shown(tmp_path):
    mqtt = config_of(tmp_path, f'[mqtt]\nusername = "u"\npassword_file = "{SECRET}"').mqtt
    with pytest.raises(UserError, match=r"password file .*: no such file") as caught:
        mqtt.address()
    assert SECRET not in str(caught.value)


@pytest.mark.parametrize("content", ["", "\n", "a\nb\n"])
def test_a_password_file_holds_one_line(tmp_path, content):
    (tmp_path / "p").write_text(content)
    mqtt = config_of(tmp_path, f'[mqtt]\nusername = "u"\npassword_file = "{tmp_path}/p"').mqtt
    with pytest.raises(UserError, match="in one line"):
        mqtt.address()


def test_systemds_credentials_are_found(tmp_path, monkeypatch):
    mqtt = config_of(tmp_path, '[mqtt]\nusername = "u"\npassword_file = "$CREDENTIALS_DIRECTORY/mqtt.password"').mqtt
    monkeypatch.delenv("CREDENTIALS_DIRECTORY", raising=False)
    with pytest.raises(UserError, match="LoadCredential"):
        mqtt.address()
    (tmp_path / "mqtt.password").write_text(f"{SECRET}\n")
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    assert mqtt.address().password == SECRET


def test_settings_in_a_traceback_or_a_log_do_not_show_the_password(tmp_path):
    config = config_of(
        tmp_path,
        f'[mqtt]\nusername = "u"\npassword = "{SECRET}"\n[sink]\ndatabase = "postgresql://u:{SECRET}@h/n"\n',
    )
    assert SECRET not in repr(config) + repr(config.mqtt.address()) + str(config.mqtt.address())


def test_a_password_in_clear_text_is_warned_of(tmp_path, caplog):
    text = f'[mqtt]\nhost = "HOST"\nusername = "u"\npassword = "{SECRET}"\n'
    config_of(tmp_path, text.replace("HOST", "127.0.0.1")).mqtt.address()
    assert not caplog.records
    config_of(tmp_path, text.replace("HOST", "10.0.0.5")).mqtt.address()
    assert "clear text" in caplog.text and SECRET not in caplog.text


DATABASES = [
    f"postgresql//u:{SECRET}@h/n",
    f"postgresql://u:{SECRET}:5432/n",
    f"postgresql://u:x@{SECRET}@h:5/n",
    f"postgresq://u:{SECRET}@h/n",
    f"postgresql://u:{SECRET}/x@127.0.0.1:1/n",
    f"postgresql://127.0.0.1:1/n?password={SECRET}",
    f"postgresql://u:{SECRET}@127.0.0.1:1/n",
    f"postgres://{SECRET}@@h",
    f"sqlite://u:{SECRET}@h/n",
    f"://{SECRET}",
]


@pytest.mark.parametrize("url", DATABASES)
@pytest.mark.parametrize("command", ["sink", "doctor", "dataset"])
def test_a_mistyped_database_does_not_show_its_password(tmp_path, url, command):
    (tmp_path / "c.toml").write_text(f'[mqtt]\nenabled = false\n[sink]\ndatabase = "{url}"\n')
    words = {
        "sink": ("sink", "completeness", "--database", url, "--day", "2026-01-01"),  # `acqd sink` waits for a server
        "doctor": ("doctor", "--config", "c.toml", "--json"),
        "dataset": ("dataset", "build", "--power", url, "--logs", tmp_path, "--robot", "ur10e", "--out", "ds"),
    }[command]
    done = acqd_here(*words, cwd=tmp_path)
    assert done.returncode in (1, 2)
    assert SECRET not in done.stdout + done.stderr
