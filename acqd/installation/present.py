"""What is installed below a root already, so that a repeated installation keeps it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from acqd.errors import InputError, UserError
from acqd.installation.plan import CONFIGURATION, DEFAULT_SERVICES, LOGINS, SERVICES, Wanted
from acqd.toml_file import tables_of

_UNITS = "/etc/systemd/system"
_DROP_INS = f"{_UNITS}/acqd.service.d"
_CREDENTIAL = "$CREDENTIALS_DIRECTORY/mqtt.password"  # what an installation with a broker writes into acqd.toml


@dataclass(frozen=True, slots=True)
class Present:
    """An installation as it is."""

    device: str | None
    """Name that the daemon logs in with, or of its device where no broker was set up."""
    services: tuple[str, ...]
    """Names in SERVICES; where the bridges' common unit is there, all bridges."""
    enabled: tuple[str, ...]
    """Services that systemd starts with the computer."""
    drop_ins: tuple[str, ...]
    archive: str | None
    broker: bool | None
    """Whether the services log in with passwords made here; None: nothing is installed or configured."""
    configured_archive: str | None
    """Folder of samples in the daemon's configuration; None: the daemon keeps none, or has no configuration."""
    configured: bool
    """Whether the daemon has a configuration."""
    earlier: tuple[str, ...]
    """Logins whose services have a configuration file of that name, as an earlier version wrote them."""
    links: tuple[str, ...]
    """Logins whose earlier file is merged, with a link to acqd.toml in its place for units of the earlier version."""
    without_user: tuple[str, ...]
    """Logins that the configuration gives the daemon's name, though the password is their unit's."""


def present_in(at: Callable[[str], Path]) -> Present:
    """Read the units and the daemon's configuration; `at` places a path below the root. Raises InputError."""
    config = _configuration(at(CONFIGURATION))

    def file_of(login: str) -> Path:
        return at(f"/etc/acqd/{login}.toml")

    services = tuple(name for name, one in SERVICES.items() if at(f"{_UNITS}/{one.units[0]}").exists())
    links = {link.name for link in at(_UNITS).glob("*.wants/acqd*")}
    mqtt, archive = _table(config, "mqtt"), _table(config, "archive")
    user = _matched(at(f"{_DROP_INS}/password.conf"), r"^LoadCredential=mqtt\.password:/etc/acqd/(.+)\.password$")
    broker: bool | None = None
    if services:
        broker = any(at(_UNITS).glob("acqd*.service.d/password.conf"))
    elif config is not None:
        broker = mqtt.get("password_file") == _CREDENTIAL
    device = (config or {}).get("device")
    return Present(
        device=(mqtt.get("username") or user or device) if broker else device,
        services=services,
        enabled=tuple(name for name in services if SERVICES[name].enabled in links),
        drop_ins=tuple(name for name in ("raw-network", "serial") if at(f"{_DROP_INS}/{name}.conf").exists()),
        archive=_matched(at(f"{_DROP_INS}/archive.conf"), r"^ReadWritePaths=-(.+)$"),
        broker=broker,
        configured_archive=archive.get("folder") if archive.get("enabled") else None,
        configured=config is not None,
        earlier=tuple(name for name in LOGINS if (path := file_of(name)).is_file() and not path.is_symlink()),
        links=tuple(name for name in LOGINS if file_of(name).is_symlink()),
        without_user=tuple(name for name in LOGINS if mqtt.get("password_file") == _CREDENTIAL and name not in mqtt),
    )


def kept(wanted: Wanted, present: Present) -> Wanted:
    """What is wanted together with what is there. Raises UserError for what contradicts the kept configuration."""
    device = wanted.device or present.device or "box"
    if present.device not in (None, device):
        raise UserError(
            f"--device {device}: {present.device} is installed here, and {CONFIGURATION} stays as it is; "
            f"leave --device out, or write {device} for device and [mqtt] username there first"
        )
    if wanted.archive and present.configured and wanted.archive != present.configured_archive:
        raise UserError(
            f"--archive {wanted.archive}: {CONFIGURATION} stays as it is and does not keep samples there; "
            f'write enabled = true and folder = "{wanted.archive}" into its [archive] first'
        )
    services = tuple(dict.fromkeys((*_asked(wanted, present), *present.services)))
    unknown = {SERVICES[name].login for name in services} & set(present.without_user) - set(present.earlier)
    if unknown:
        raise UserError(
            f"{CONFIGURATION} has no user of the broker for {', '.join(sorted(unknown))}: "
            f"acqd config upgrade {CONFIGURATION} adds what is missing"
        )
    broker = wanted.broker if wanted.broker is not None else present.broker is not False
    return replace(
        wanted,
        device=device,
        services=services,
        earlier=present.earlier,
        drop_ins=tuple(dict.fromkeys((*present.drop_ins, *wanted.drop_ins))),
        archive=wanted.archive or present.archive,
        broker=broker,
    )


def to_start(wanted: Wanted, present: Present) -> list[str]:
    """Services to be started: those asked for and those installed, of the bridges only the enabled ones."""
    before = [name for name in present.services if not name.startswith("bridge-") or name in present.enabled]
    return list(dict.fromkeys((*_asked(wanted, present), *before)))


def _asked(wanted: Wanted, present: Present) -> tuple[str, ...]:
    return wanted.services or (() if present.services else DEFAULT_SERVICES)


def _configuration(path: Path) -> dict[str, Any] | None:
    try:
        if not path.exists():
            return None
        return tables_of(path)
    except PermissionError:
        raise UserError(f"{path}: this user may not read it; use sudo") from None
    except InputError as error:
        raise UserError(f"{error}; mend the file first, the installation keeps this file") from None


def _table(config: dict[str, Any] | None, name: str) -> dict[str, Any]:
    table = (config or {}).get(name)
    return table if isinstance(table, dict) else {}


def _matched(path: Path, pattern: str) -> str | None:
    found = re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE) if path.exists() else None
    return found[1] if found else None
