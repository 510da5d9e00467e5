"""Which configuration file a command uses, and what an installed one means outside of its units."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import TYPE_CHECKING

from acqd.daemon.integration_sections import integration_tables
from acqd.daemon.mqtt_section import USERS, BrokerUser, MqttSection, in_credentials

if TYPE_CHECKING:
    from acqd.daemon.config import Config

_log = logging.getLogger(__name__)

PLACES = (Path("acqd.toml"), Path("/etc/acqd/acqd.toml"))
"""Where a command without --config looks, in this order."""
SERVICES_STATE = Path("/var/lib/acqd")
"""State folder of the installed services (`StateDirectory=acqd`)."""


def found_config() -> tuple[Path | None, str]:
    """The first file that is there, and a sentence about it; None where no file can be used."""
    for path in PLACES:
        try:
            there = path.is_file()
            readable = there and os.access(path, os.R_OK)
        except PermissionError:
            there, readable = True, False
        if readable:
            return path, f"configuration: {path.absolute()}"
        if there:
            return None, f"{path.absolute()} is not used: this user may not read it; use sudo, or --config FILE"
    return None, ""


def as_installed(config: Config, path: Path) -> None:
    """Give a configuration in ROOT/etc/acqd the folder and the password that the units have, where no unit does.

    systemd passes both to services in the environment, and starts them in the folder; a command typed by hand has
    neither, and works elsewhere. Files are named, not opened: what root alone may read stays so.
    """
    folder = path.absolute().parent
    if folder.parts[-2:] != ("etc", "acqd"):
        return
    if path.stem in USERS and not path.is_symlink():
        _log.warning("%s is of an earlier version: acqd config upgrade merges it into acqd.toml", path)
    state = folder.parents[1] / SERVICES_STATE.relative_to("/")
    by_hand = "STATE_DIRECTORY" not in os.environ
    if by_hand and config.state_dir is None and _exists(state):
        config.state_dir = state
    if by_hand:
        _find_files(config, state)
    if "CREDENTIALS_DIRECTORY" not in os.environ:
        shared = config.mqtt.password_file
        for user in config.mqtt.users.values():
            if user.password is None and user.password_file is None:
                user.password_file = shared  # another file for every user
        logins: list[MqttSection | BrokerUser] = [config.mqtt, *config.mqtt.users.values()]
        for login in logins:
            _find_credentials(login, folder)


def _find_files(config: Config, state: Path) -> None:
    """Put the folder in which units work in front of relative names."""
    database = config.sink.database
    if "://" not in database:
        config.sink.database = str(state / database)
    for name in integration_tables():
        table = getattr(config, name)
        for key in table.in_working_folder:
            if (file := getattr(table, key)) is not None:
                setattr(table, key, state / file)


def _find_credentials(login: MqttSection | BrokerUser, folder: Path) -> None:
    """Replace what systemd would pass by the files that it reads: USER.password, and others by their name."""
    password = login.password_file
    if password is not None and in_credentials(password):
        for name in (f"{login.username}.password", password.name):
            if _exists(folder / name):
                login.password_file = folder / name
                break
    for key in ("cert_file", "key_file"):
        path = getattr(login, key)
        if path is not None and in_credentials(path) and _exists(folder / path.name):
            setattr(login, key, folder / path.name)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except PermissionError:
        return True  # whoever opens it says so
