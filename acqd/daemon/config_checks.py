"""The checks of `acqd config check`: what a configuration names is there, and its logins work."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path

from acqd.daemon.broker_checks import OPEN_TO_ALL, broker_checks, name_check
from acqd.daemon.checks import database_check
from acqd.daemon.config import Config
from acqd.daemon.finding import Finding
from acqd.errors import UserError
from acqd.section import Section
from acqd.telemetry import certificates
from acqd.telemetry.mqtt import BrokerAddress, is_loopback

_ANYWHERE = ("0.0.0.0", "::", "localhost")  # noqa: S104
"""Hosts that share their ports with those of other names."""


def config_checks(config: Config, *, connect: bool) -> list[Finding]:
    """Passwords, certificates, files and folders; with `connect` also the broker for every user, and the database."""
    found = [*_logins(config), *_ports(config), *_places(config), *_secrets(config)]
    found += [*broker_checks(config, away="fail"), database_check(config)] if connect else name_check(config)
    return found


def _logins(config: Config) -> Iterator[Finding]:
    users = {name: config.mqtt.of(name) for name in config.mqtt.users}
    for name, login in {"mqtt": config.mqtt, **{f"mqtt.{user}": section for user, section in users.items()}}.items():
        if name.removeprefix("mqtt.") in config.mqtt.without_password:
            yield Finding(name, "ok", f"as {login.username}: no password, so the service is not installed here")
            continue
        who = f"as {login.username}" if login.username else "without a user"
        try:
            address = login.address(warn=False)
            why = certificates.trouble(login.certificates)
        except UserError as error:
            yield Finding(name, "fail", f"{who}: {error}", "is its file there, and may this user read it (sudo)?")
            continue
        files = {key: getattr(address, key) for key in ("ca_file", "cert_file", "key_file")}
        if unreadable := [f"{key}: {path} cannot be read" for key, path in files.items() if _closed(path)]:
            yield Finding(name, "fail", f"{who}: {unreadable[0]}", "is it there, and may this user read it?")
        elif wrong := _no_certificates(address):
            yield Finding(name, "fail", f"{who}: {wrong}", "another file, or leave the key out")
        elif address.password is not None and login.username is None:
            yield Finding(name, "warn", "a password without username: brokers do not look at it", "add username")
        elif why:
            yield Finding(name, "warn", f"{who}: {why}", "make another one (config/make-certificates.sh)")
        else:
            password = "" if address.password is not None else ", no password"
            yield Finding(name, "ok", f"{who} at {address}{password}")


def _no_certificates(address: BrokerAddress) -> str:
    """What in the files is no certificate or no key; else empty."""
    try:
        address.tls_context()
    except UserError as error:
        return str(error)
    return ""


def _ports(config: Config) -> Iterator[Finding]:
    """Services of one computer that want the same port: the second one to start has none.

    A service whose port is not in the file may run on another computer, or nowhere.
    """
    health, web, opcua = config.health, config.web, dict(config)["opcua"]
    wanted = [
        ("health.port", health.port, health.host, True),
        ("health.sink_port", health.sink_port, health.host, "sink_port" in health.model_fields_set),
        ("web.port", web.port, web.host, web.enabled or "port" in web.model_fields_set),
        ("opcua.port", opcua.port, opcua.host, "port" in opcua.model_fields_set),
    ]
    if is_loopback(config.mqtt.host):
        wanted.append(("mqtt.port", config.mqtt.port, _ANYWHERE[0], True))
    for (key, port, host, here), (other, its_port, its_host, other_here) in itertools.combinations(wanted, 2):
        if port and port == its_port and (host == its_host or not {host, its_host}.isdisjoint(_ANYWHERE)):
            finding, advice = f"{key} and {other} are both {port}", "give each a port of its own"
            if here and other_here:
                yield Finding("ports", "fail", finding, advice)
            else:
                yield Finding("ports", "warn", finding, f"{advice}, where both services run on this computer")


def _places(config: Config) -> Iterator[Finding]:
    named = {
        "state_dir": config.state_dir,
        "archive.folder": config.archive.folder if config.archive.enabled else None,
        **{f"{name}.{key}": getattr(section, key) for name, section in _sections(config) for key in section.must_exist},
    }
    for key, path in named.items():
        if path is None:
            continue
        path = Path(path)
        if not path.exists():
            yield Finding(key, "fail", f"{path.absolute()} does not exist", "make it, or change the key")
        elif key in ("state_dir", "archive.folder") and not path.is_dir():
            yield Finding(key, "fail", f"{path.absolute()} is a file, not a folder", "move it away, or change the key")
        elif not os.access(path, os.R_OK):
            yield Finding(key, "fail", f"this user may not read {path}", "sudo, or other permissions")
        else:
            yield Finding(key, "ok", str(path))


def _sections(config: Config) -> Iterator[tuple[str, Section]]:
    """Tables by name; of several boxes those that are used."""
    for name, section in config:
        if isinstance(section, Section) and not (name == "source" and config.sources):
            yield name, section
    yield from ((f"source of {', '.join(box.devices)}", box.source) for box in config.sources)


def _secrets(config: Config) -> Iterator[Finding]:
    proxy, check = config.web.proxy, "web.proxy.secret_file"
    if proxy is None:
        return
    try:
        proxy.secret()
    except UserError as error:
        yield Finding(check, "fail", str(error), "is it there, and may this user read it (sudo)?")
        return
    if proxy.secret_file.stat().st_mode & OPEN_TO_ALL:
        yield Finding(check, "warn", f"every user may open {proxy.secret_file}", f"chmod o= {proxy.secret_file}")
    else:
        yield Finding(check, "ok", str(proxy.secret_file))


def _closed(path: Path | None) -> bool:
    return path is not None and not os.access(path, os.R_OK)
