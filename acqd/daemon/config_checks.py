"""The checks of `acqd config check`: what a configuration names is there, and its logins work."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from acqd.daemon.broker_checks import OPEN_TO_ALL, broker_checks
from acqd.daemon.checks import database_check
from acqd.daemon.config import Config
from acqd.daemon.finding import Finding
from acqd.errors import UserError
from acqd.section import Section
from acqd.telemetry import certificates


def config_checks(config: Config, *, connect: bool) -> list[Finding]:
    """Passwords, certificates, files and folders; with `connect` also the broker for every user, and the database."""
    found = [*_logins(config), *_places(config), *_secrets(config)]
    if connect:
        found += [*broker_checks(config, away="fail"), database_check(config)]
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
        if unreadable := [path for path in (address.ca_file, address.cert_file, address.key_file) if _closed(path)]:
            yield Finding(name, "fail", f"{unreadable[0]} cannot be read", "is it there, and may this user read it?")
        elif why:
            yield Finding(name, "warn", f"{who}: {why}", "make another one (config/make-certificates.sh)")
        else:
            password = "" if address.password is not None else ", no password"
            yield Finding(name, "ok", f"{who} at {address}{password}")


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
