"""Which configuration file a command uses, and what an installed one means outside of its units."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from acqd.daemon.config import Config

PLACES = (Path("acqd.toml"), Path("/etc/acqd/acqd.toml"))
"""Where a command without --config looks, in this order."""
SERVICES_STATE = Path("/var/lib/acqd")
"""State folder of the installed services (`StateDirectory=acqd`)."""
_CREDENTIAL = Path("$CREDENTIALS_DIRECTORY/mqtt.password")


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

    systemd passes both to services in the environment; a command typed by hand has neither. Files are named, not
    opened: what root alone may read stays so.
    """
    folder = path.absolute().parent
    if folder.parts[-2:] != ("etc", "acqd"):
        return
    state = folder.parents[1] / SERVICES_STATE.relative_to("/")
    by_hand = "STATE_DIRECTORY" not in os.environ
    if by_hand and config.state_dir is None and _exists(state):
        config.state_dir = state
    database = config.sink.database
    if by_hand and "://" not in database and not Path(database).is_absolute():
        config.sink.database = str(state / database)
    secret = folder / f"{config.mqtt.username}.password"
    if "CREDENTIALS_DIRECTORY" not in os.environ and config.mqtt.password_file == _CREDENTIAL and _exists(secret):
        config.mqtt.password_file = secret


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except PermissionError:
        return True  # whoever opens it says so
