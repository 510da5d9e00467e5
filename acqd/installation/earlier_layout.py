"""Configuration files of an earlier version, one per service, merged into acqd.toml.

Each was a whole acqd.toml of which its service used a part. What a service did stays as it is; where that cannot be
said in one file, nothing is merged.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acqd.daemon.config import Config
from acqd.daemon.config_file import parsed_config, read_toml
from acqd.daemon.config_values import shown, values_of
from acqd.errors import InputError
from acqd.installation.plan import LOGINS

_OWN = {
    "sink": ("sink", "health.sink_port"),
    "sidecar": (),
    "web": ("web",),
    "bridge": ("homeassistant", "influx", "opcua", "alarms", "plain", "sparkplug"),
}
"""Sections and keys that only the services of this file read: the file says what they are."""
_SHARED = {
    "sink": ("mqtt", "health.host"),
    "sidecar": ("mqtt", "device", "sink.database"),
    "web": ("mqtt", "device", "state_dir", "health", "archive", "sink.database"),
    "bridge": ("mqtt",),
}
"""What these services read as the daemon does, or the sink."""
_USER = ("username", "password", "password_file", "cert_file", "key_file")
_CREDENTIAL = "$CREDENTIALS_DIRECTORY/mqtt.password"


@dataclass(frozen=True, slots=True)
class Merged:
    """What acqd.toml gets from the files of the services."""

    values: dict[str, Any] = field(default_factory=dict, repr=False)
    """By key, as section.key; None: the key goes."""
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    """Files that have no use after the merge."""


def merged(main: Path, config: Config) -> Merged:
    """Values for `main`, the acqd.toml next to the files. Raises InputError where files contradict each other."""
    values: dict[str, Any] = {}
    notes: list[str] = []
    contradictions: list[str] = []
    files = tuple(path for name in _OWN if (path := main.with_name(f"{name}.toml")).is_file() and not path.is_symlink())
    plain, known = values_of(Config()), values_of(config)
    for path in files:
        raw = read_toml(path)
        theirs = parsed_config(raw, path)
        values |= _user(path.stem, raw, config, theirs)
        for key, value in values_of(theirs).items():
            mine = values.get(key, known.get(key))
            if value == mine or _is_user(key):
                continue
            there, here = shown(key, value), shown(key, mine)
            if _within(key, _OWN[path.stem]):
                values[key] = value
                notes.append(f"{key} = {there}, as {path.name} says")
            elif not _within(key, _SHARED[path.stem]):
                if value != plain.get(key):
                    notes.append(f"{path.name}: {key} = {there} had no effect and is left out")
            elif value == plain.get(key):
                notes.append(f"{key} = {here} now holds for the services of {path.name} too (there: the default)")
            else:
                contradictions.append(f"{key} is {here}, and {there} in {path.name}")
    if contradictions:
        raise InputError(main, f"{'; '.join(contradictions)}; write the same value into both files, then upgrade")
    return Merged(values, tuple(notes), files)


def missing_users(config: Config, folder: Path) -> dict[str, Any]:
    """Users of services that log in with the password of their unit, and that the file gives the daemon's name."""
    if str(config.mqtt.password_file) != _CREDENTIAL:
        return {}
    return {
        f"mqtt.{login}": {"username": user}
        for login, user in LOGINS.items()
        if getattr(config.mqtt, login) is None and not folder.joinpath(f"{login}.toml").exists()
    }


def _user(login: str, raw: dict[str, Any], main: Config, theirs: Config) -> dict[str, Any]:
    """The user of a service, where it is not the daemon's."""
    if getattr(main.mqtt, login) is not None:
        return {}
    mqtt = raw.get("mqtt", {})
    given = {key: mqtt[key] for key in _USER if key in mqtt}
    same = all(getattr(theirs.mqtt, key) == getattr(main.mqtt, key) for key in _USER)
    if not given or same:
        return {}
    if given.get("password_file") == str(main.mqtt.password_file) == _CREDENTIAL:
        del given["password_file"]  # of the unit, for every service
    return {f"mqtt.{login}": given}


def _within(key: str, places: tuple[str, ...]) -> bool:
    return any(key == place or key.startswith(f"{place}.") for place in places)


def _is_user(key: str) -> bool:
    return key in {f"mqtt.{name}" for name in (*_USER, *LOGINS, "queue")}
