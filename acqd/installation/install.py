"""Carries an installation out below a root folder, and undoes it. Both may be repeated."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from acqd.errors import OperationError, UserError
from acqd.installation.broker_access import new_password, with_passwords
from acqd.installation.plan import SERVICES, File, Wanted, files_of, require_reachable, users_of
from acqd.installation.present import Present, kept, present_in, to_start
from acqd.installation.root import Root
from acqd.installation.state import FAILING, last_line, state_of

_PASSWORDS = "/etc/mosquitto/acqd.passwords"
_TIMER_STAMP = "/var/lib/systemd/timers/stamp-acqd-maintain.timer"
_DATA = ("/var/lib/acqd", "/var/cache/acqd", "/etc/acqd")
_ASIDE = (
    "etc/acqd.before-*",
    "var/lib/acqd.before-*",
    "etc/mosquitto/acqd.*.before-*",
    "etc/mosquitto/*/acqd.*.before-*",
)
"""What restores have moved aside."""
_SETTLED_S = 3.0
"""Time in which a service that lacks a library or a setting has ended again."""


def install(wanted: Wanted, root: Root, *, start: bool) -> None:
    """Users and folders, configuration, units, access to the broker; `start`: enable the services and start them.

    What a person may have edited stays as it is: configuration, passwords and access rules. So do the device, services,
    rights and folders that are installed. Raises UserError, OperationError.
    """
    root.require_rights()
    if root.live:
        require_reachable(wanted.program)
        if start and not root.managed:
            raise UserError(
                "systemd does not run on this computer, so nothing can be started: "
                "--no-start only installs, and acqd run --config /etc/acqd/acqd.toml is the daemon by hand"
            )
    present = present_in(root.at)
    _carry_out(kept(wanted, present), present, root)
    if root.live and start:
        reload(root)
        _start(_started(to_start(wanted, present)), root)


def update(program: str, root: Root) -> None:
    """Units, rights and folders of this version for what is installed; what runs is restarted.

    Device, credentials and configuration stay. Raises UserError where nothing is installed, OperationError.
    """
    root.require_rights()
    if root.live:
        require_reachable(program)
    present = present_in(root.at)
    if not present.services:
        raise UserError(f"no service of acqd is installed below {root.folder}; acqd service install is the first step")
    units = running(root, present.services)
    _carry_out(kept(Wanted(program), present), present, root)
    if root.managed:
        reload(root)
    for unit in units:
        root.run("systemctl", "restart", unit)
        root.done.append(f"restarted {unit}")


def _carry_out(wanted: Wanted, present: Present, root: Root) -> None:
    """Write what is wanted."""
    if wanted.broker:
        require_broker(root)
    wanted = replace(wanted, passwords=_missing_passwords(wanted, root))
    root.require_places([*files_of(wanted), *([File(_PASSWORDS, "")] if wanted.broker else [])])
    if wanted.archive and (folder := root.at(wanted.archive)).exists() and not folder.is_dir():
        raise UserError(f"--archive {wanted.archive}: is a file, not a folder; choose another one")
    make_user(wanted, root)
    for file in files_of(wanted):
        root.write(file)
    if wanted.broker:
        _write_passwords(wanted, root)
    for name in present.links:  # an upgraded configuration keeps these names for units of an earlier version
        root.remove(f"/etc/acqd/{name}.toml")


def make_user(wanted: Wanted, root: Root) -> None:
    """The user acqd and the folders."""
    for file in files_of(wanted):
        if file.path.startswith(("/etc/sysusers.d", "/etc/tmpfiles.d")):
            root.write(file)
    root.rooted("systemd-sysusers", "acqd.conf")
    root.rooted("systemd-tmpfiles", "--create", "acqd.conf")


def require_broker(root: Root) -> None:
    """Raises UserError where there is no mosquitto whose users could be made."""
    if root.group("mosquitto") is None:
        where = "" if root.live else f" below {root.folder}"
        raise UserError(
            f"mosquitto is not installed{where}: apt-get install mosquitto, or --no-broker for a broker elsewhere"
        )


def running(root: Root, services: Sequence[str]) -> list[str]:
    """Units of services that run now."""
    return [unit for unit in _started(services) if root.active(unit)]


def reload(root: Root) -> None:
    """Have systemd and the broker read what has changed."""
    root.run("systemctl", "daemon-reload")
    if root.at(_PASSWORDS).exists():
        root.run("systemctl", "restart", "mosquitto.service", needed=False)


def remove(root: Root, *, purge: bool, sure: bool = False) -> None:
    """Stop and remove the services and the access to the broker. `purge`: configuration, data and the user as well.

    Raises UserError, also where `purge` would delete something and nobody is `sure`; OperationError.
    """
    root.require_rights()
    there = [name for name in _DATA if root.at(name).exists()]
    if purge and there and not sure:
        raise UserError(f"--purge deletes {', '.join(there)} for good: acqd service backup keeps a copy, --yes goes on")
    _stop(root)
    wanted = Wanted("acqd", tuple(SERVICES), drop_ins=("raw-network", "serial"), archive="/anywhere", broker=True)
    for file in reversed(files_of(wanted)):
        if not file.keep or file.path.startswith("/etc/mosquitto"):
            root.remove(file.path)
    root.remove(_PASSWORDS)
    _forget(root)
    if purge:
        root.remove(_TIMER_STAMP)
        for name in there:
            root.remove_folder(name)
        _remove_user(root)
        aside = sorted(path for pattern in _ASIDE for path in root.folder.glob(pattern))
        root.done += [f"kept /{path.relative_to(root.folder)}, which a restore has moved aside" for path in aside]


def _stop(root: Root) -> None:
    """Stop and disable the services that are installed."""
    installed = [each for each in SERVICES.values() if root.at(f"/etc/systemd/system/{each.units[0]}").exists()]
    for service in installed if root.managed else []:
        root.run("systemctl", "disable", "--now", service.enabled, needed=False)


def _forget(root: Root) -> None:
    """Have systemd and the broker forget what was removed."""
    if root.managed:
        root.run("systemctl", "daemon-reload", needed=False)
        if any(done.startswith("removed /etc/mosquitto") for done in root.done):
            root.run("systemctl", "restart", "mosquitto.service", needed=False)


def _remove_user(root: Root) -> None:
    if root.group("acqd") is None:
        return
    prefix = [] if root.live else ["--prefix", str(root.folder)]
    root.run("userdel", *prefix, "acqd")
    if root.group("acqd") is not None:  # userdel leaves the group where login.defs does not name USERGROUPS_ENAB
        root.run("groupdel", *prefix, "acqd")
    root.done.append("removed the user acqd")


def _started(services: Sequence[str]) -> list[str]:
    """Units to be enabled: of maintenance the timer only."""
    return [SERVICES[service].enabled for service in services]


def _start(units: Sequence[str], root: Root) -> None:
    """Enable the units and start one after the other; raises OperationError at the end for those that fail.

    systemd calls a service started that ends a moment later, so all are looked at once more.
    """
    root.run("systemctl", "enable", *units)
    stopped = [unit for unit in units if not root.active(unit)]
    for unit in stopped:
        root.succeeds("systemctl", "start", unit)
    if stopped:
        time.sleep(_SETTLED_S)
    failed = [unit for unit in units if state_of(unit)[0] in (FAILING, "failed", "inactive")]
    root.done += [f"started {unit}" for unit in stopped if unit not in failed]
    if failed:
        reasons = "; ".join(f"{unit}: {last_line(unit) or f'journalctl -u {unit}'}" for unit in failed)
        raise OperationError(f"installed, but not running yet: {reasons}")


def _missing_passwords(wanted: Wanted, root: Root) -> dict[str, str]:
    """New passwords of users of the broker that have none yet."""
    if not wanted.broker:
        return {}
    files = {user: root.at(f"/etc/acqd/{user}.password") for user in users_of(wanted)}
    for file in [file for file in files.values() if file.is_file()]:
        _password(file)
    _text(root.at(_PASSWORDS))
    return {user: new_password() for user, file in files.items() if not file.exists()}


def _password(file: Path) -> str:
    """The one line of a password file. Raises UserError."""
    lines = _text(file).split("\n")
    if not lines[0].strip() or any(lines[1:]):
        what = "is empty" if not any(lines) else "is not one line"
        raise UserError(f"{file}: {what}; delete it, and a new password is made")
    return lines[0].strip()


def _text(file: Path) -> str:
    """The text of a file, empty where none is. Raises UserError."""
    try:
        return file.read_text(encoding="utf-8") if file.is_file() else ""
    except UnicodeDecodeError:
        raise UserError(f"{file}: is no text; move it away, and a new one is made") from None


def _write_passwords(wanted: Wanted, root: Root) -> None:
    """The broker's file of passwords, which `remove` deletes: of all users of this installation."""
    path = root.at(_PASSWORDS)
    others = [line for line in _text(path).splitlines() if line.partition(":")[0] not in wanted.passwords]
    files = {user: root.at(f"/etc/acqd/{user}.password") for user in users_of(wanted)}
    passwords = {user: _password(file) for user, file in files.items()}
    root.write(File(_PASSWORDS, with_passwords("\n".join(others), passwords), 0o640, "mosquitto"))
