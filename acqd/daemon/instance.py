"""Who this daemon is: the id of its installation, kept in state_dir, and the name that it claims with it."""

from __future__ import annotations

import logging
import re
import socket
import time
import uuid
from pathlib import Path

from acqd.atomic import write_complete
from acqd.errors import OperationError
from acqd.regular_file import read_regular
from acqd.telemetry.ask import Claimant
from acqd.timestamps import rfc3339

_log = logging.getLogger(__name__)
_ID = re.compile(r"[0-9a-f]{12}")
_MOST_BYTES = 4096


def instance_id(state_dir: Path | None) -> str:
    """The same after a restart; without a state_dir, of this run only."""
    if state_dir is None:
        return uuid.uuid4().hex[:12]
    path = state_dir / "instance"
    try:
        if _ID.fullmatch(known := read_regular(path, _MOST_BYTES).decode().strip()):
            return known
    except (OSError, UnicodeDecodeError):
        pass  # the first start, or a file that nobody can read: another id is only less well known
    made = uuid.uuid4().hex[:12]
    try:
        write_complete(path, made.encode())
    except OperationError as error:
        _log.warning("%s", error)
    return made


def claimant(state_dir: Path | None, boot: str, *, take_name: bool) -> Claimant:
    """This run. `take_name`: a person says that it is to have the name."""
    host = socket.gethostname()[:128]
    return Claimant(instance_id(state_dir), boot, host, rfc3339(time.time_ns()), take_name)


def name_of_host() -> str:
    """A device name for a run without a configuration, of letters that a topic takes."""
    host = re.sub(r"[^A-Za-z0-9_.-]", "-", socket.gethostname().partition(".")[0])[:48].strip("-.")
    return f"acqd-{host}" if host else "acqd"
