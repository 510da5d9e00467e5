"""One robot of a fleet, and the identity of its inputs."""

from __future__ import annotations

import hashlib
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import orjson

from acqd.dataset.log_files import content_hash, log_files
from acqd.dataset.regressors import TorqueSource
from acqd.errors import InputError
from acqd.models.bundle.bundle import fingerprint

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}")
_FORMAT = 1
"""Of what is kept of a robot: another number does everything again."""


@dataclass(frozen=True, slots=True)
class FleetRobot:
    """Where the data of a robot lie. Paths are absolute."""

    name: str
    model: Path
    dataset: Path | None = None
    power: str | None = None
    logs: Path | None = None
    description: str | None = None
    device: str | None = None
    channel: str | None = None
    torque: TorqueSource | None = None
    search_s: float = 2.4
    lag_s: float | None = None
    cut_s: float | Literal["auto"] | None = None

    def settings_digest(self) -> str:
        """Hash of what decides how the dataset is built."""
        own = {key: value for key, value in asdict(self).items() if key not in ("name", "model")}
        return digest({"format": _FORMAT, **own})

    def log_hashes(self) -> dict[str, Path]:
        """The robot's logs by content. Raises UserError, InputError."""
        assert self.logs is not None
        try:
            return {content_hash(path): path for path in log_files(self.logs)}
        except OSError as error:
            raise InputError(error.filename, f"cannot be read ({error.strerror})") from None

    def model_digest(self) -> str:
        """Hash of the bundle. Raises InputError."""
        try:
            return fingerprint(self.model)
        except OSError as error:
            raise InputError(
                self.model, f"is no bundle that can be read ({error.strerror}); acqd train writes bundles"
            ) from None


def digest(content: dict[str, Any]) -> str:
    """SHA-256 of a JSON object."""
    text = orjson.dumps(content, option=orjson.OPT_SORT_KEYS | orjson.OPT_SERIALIZE_NUMPY, default=str)
    return hashlib.sha256(text).hexdigest()


def power_stamp(origin: str) -> str | None:
    """Changes when a file of power rows changes; None for a server, where nobody can say."""
    if "://" in origin and not origin.startswith("sqlite:///"):
        return None
    path = Path(origin.removeprefix("sqlite:///"))
    try:
        known = path.stat()
    except OSError:
        return "missing"
    log = path.with_name(f"{path.name}-wal")  # rows that a sink stored last are here first
    late = f" {log.stat().st_size}" if log.exists() and log.stat().st_size else ""
    return f"{known.st_size} {known.st_mtime_ns}{late}"
