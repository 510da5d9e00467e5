"""The energy registers on disk, so that W goes on where it was after a restart."""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path

_log = logging.getLogger(__name__)


class RegisterFile:
    """One small JSON file per device, replaced atomically."""

    def __init__(self, folder: Path, device: str) -> None:
        self._path = folder / f"energy-{device}.json"

    def load(self, phases: int) -> list[tuple[float, float]] | None:
        """Each phase's (imported, exported) [kWh], None to start from zero."""
        try:
            data = json.loads(self._path.read_text(encoding="utf-8"))
            pairs = [(float(pair["import_kWh"]), float(pair["export_kWh"])) for pair in data["phases"]]
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError) as error:
            _log.error("%s is unreadable (%s): energy starts from zero", self._path, error)
            return None
        if len(pairs) != phases:
            _log.error("%s is of %d phases, now %d: energy starts from zero", self._path, len(pairs), phases)
            return None
        return pairs

    def save(self, readings: list[tuple[float, float]]) -> None:
        """Write the readings; a full disk is logged, never fatal."""
        data = {"phases": [{"import_kWh": imported, "export_kWh": exported} for imported, exported in readings]}
        fresh = self._path.with_suffix(".new")
        try:
            fresh.write_text(json.dumps(data), encoding="utf-8")
            os.replace(fresh, self._path)
        except OSError as error:
            _log.error("%s cannot be written: %s", self._path, error)
