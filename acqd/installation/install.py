"""Carries an installation out below a root folder, and undoes it. Both may be repeated."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from acqd.errors import OperationError, UserError
from acqd.installation.broker_access import VIEWER, new_password, with_passwords
from acqd.installation.plan import SERVICES, File, Wanted, files_of, users_of
from acqd.installation.present import kept, present_in, to_start

_PASSWORDS = "/etc/mosquitto/acqd.passwords"
_TIMER_STAMP = "/var/lib/systemd/timers/stamp-acqd-maintain.timer"
_DATA = ("/etc/acqd", "/var/lib/acqd", "/var/cache/acqd")


class Root:
    """The system that is changed: this computer, or a folder that holds the files of another one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.live = folder == Path("/")
        self.done: list[str] = []
        """What was changed, in words."""

    def at(self, path: str) -> Path:
        """An absolute path below the root."""
        return self.folder / path.lstrip("/")

    def run(self, *command: str, needed: bool = True) -> None:
        """Run a program of the system. Raises UserError without the program, OperationError when it fails."""
        if shutil.which(command[0]) is None:
            if needed:
                raise UserError(f"{command[0]} is not here: acqd service needs systemd and its tools")
            return
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode and needed:
            reason = (result.stderr.strip().splitlines() or ["failed"])[-1]
            raise OperationError(f"{' '.join(command)}: {reason}")

    def succeeds(self, *command: str) -> bool:
        """Run a program of the system, and say whether it ended with 0."""
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    def rooted(self, program: str, *arguments: str) -> None:
        """Run systemd-sysusers or systemd-tmpfiles on this root."""
        self.run(program, *([] if self.live else [f"--root={self.folder}"]), *arguments)

    def write(self, file: File) -> None:
        """Write a file unless it is there as wanted, or is to be kept."""
        path = self.at(file.path)
        if path.exists() and (file.keep or path.read_text(encoding="utf-8") == file.text):
            if file.path.endswith(".acl") and path.read_text(encoding="utf-8") != file.text:
                self.done.append(f"kept {file.path}, which differs from the rules of this version: compare them")
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_name(f".{path.name}.new")
        with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as out:
            out.write(file.text)
        group = self.group(file.group)
        if group is not None:
            os.chown(new, 0, group)
        new.chmod(file.mode)
        new.replace(path)
        self.done.append(f"wrote {file.path}")

    def group(self, name: str) -> int | None:
        """Number of a group of this root; None for one that it has not."""
        with suppress(OSError):
            for line in self.at("/etc/group").read_text(encoding="utf-8").splitlines():
                if line.startswith(f"{name}:"):
                    return int(line.split(":")[2])
        return None

    def remove(self, path: str) -> None:
        """Delete a file, and its folder of drop-ins when that is empty then."""
        target = self.at(path)
        if target.exists():
            target.unlink()
            self.done.append(f"removed {path}")
        if target.parent.name.endswith(".d"):
            with suppress(OSError):
                target.parent.rmdir()


def install(wanted: Wanted, root: Root, *, start: bool) -> None:
    """Users and folders, configuration, units, access to the broker; `start`: enable the services and start them.

    What a person may have edited stays as it is: configuration, passwords and access rules. So do the device, services,
    rights and folders that are installed. Raises UserError, OperationError.
    """
    _require_rights(root)
    present = present_in(root.at)
    started = to_start(wanted, present)
    wanted = kept(wanted, present)
    if wanted.broker and root.group("mosquitto") is None:
        raise UserError("mosquitto is not installed: apt-get install mosquitto, or --no-broker for a broker elsewhere")
    wanted = replace(wanted, passwords=_missing_passwords(wanted, root))
    made = files_of(wanted)
    first = [file for file in made if file.path.startswith(("/etc/sysusers.d", "/etc/tmpfiles.d"))]
    for file in first:
        root.write(file)
    root.rooted("systemd-sysusers", "acqd.conf")
    root.rooted("systemd-tmpfiles", "--create", "acqd.conf")
    for file in made:
        root.write(file)
    if wanted.broker:
        _write_passwords(wanted, root)
    if root.live and start:
        root.run("systemctl", "daemon-reload")
        if wanted.broker:
            root.run("systemctl", "restart", "mosquitto.service", needed=False)
        _start(_started(started), root)


def remove(root: Root, *, purge: bool) -> None:
    """Stop and remove the services and the access to the broker. `purge`: configuration, data and the user as well.

    Raises UserError, OperationError.
    """
    _require_rights(root)
    _stop(root)
    wanted = Wanted("acqd", tuple(SERVICES), drop_ins=("raw-network", "serial"), archive="/anywhere", broker=True)
    for file in reversed(files_of(wanted)):
        if not file.keep or file.path.startswith("/etc/mosquitto"):
            root.remove(file.path)
    root.remove(_PASSWORDS)
    _forget(root)
    if purge:
        root.remove(_TIMER_STAMP)
        for name in _DATA:
            if root.at(name).exists():
                shutil.rmtree(root.at(name))
                root.done.append(f"removed {name}")
        _remove_user(root)


def _stop(root: Root) -> None:
    """Stop and disable the services that are installed."""
    installed = [each for each in SERVICES.values() if root.at(f"/etc/systemd/system/{each.units[0]}").exists()]
    for service in installed if root.live else []:
        root.run("systemctl", "disable", "--now", service.enabled, needed=False)


def _forget(root: Root) -> None:
    """Have systemd and the broker forget what was removed."""
    if root.live:
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
    """Enable the units and start one after the other; raises OperationError at the end for those that fail."""
    root.run("systemctl", "enable", *units)
    failed = [unit for unit in units if not root.succeeds("systemctl", "start", unit)]
    if failed:
        raise OperationError(
            f"{', '.join(failed)}: installed, but not running yet; journalctl -u {failed[0]} says what is missing"
        )


def _require_rights(root: Root) -> None:
    if os.geteuid() != 0:
        raise UserError("acqd service changes users and system files: run it with sudo")
    if not root.folder.is_dir():
        raise UserError(f"{root.folder} is not a folder; choose another --root")


def _missing_passwords(wanted: Wanted, root: Root) -> dict[str, str]:
    """New passwords of users of the broker that have none yet."""
    if not wanted.broker:
        return {}
    users = [*users_of(wanted), VIEWER]
    return {user: new_password() for user in users if not root.at(f"/etc/acqd/{user}.password").exists()}


def _write_passwords(wanted: Wanted, root: Root) -> None:
    """The broker's file of passwords, which `remove` deletes: of all users of this installation."""
    path = root.at(_PASSWORDS)
    lines = path.read_text(encoding="utf-8") if path.exists() else ""
    others = [line for line in lines.splitlines() if line.partition(":")[0] not in wanted.passwords]
    files = {user: root.at(f"/etc/acqd/{user}.password") for user in (*users_of(wanted), VIEWER)}
    passwords = {user: file.read_text(encoding="utf-8").strip() for user, file in files.items()}
    root.write(File(_PASSWORDS, with_passwords("\n".join(others), passwords), 0o640, "mosquitto"))
