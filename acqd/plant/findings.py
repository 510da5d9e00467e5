"""What `acqd fleet` has found, by device."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson

from acqd.errors import InputError

Row = dict[str, Any]
_FILE = "report.json"


def findings(folder: Path) -> dict[str, Row]:
    """Rows of the fleet's table by the device of their power. Raises InputError."""
    path = folder / _FILE
    try:
        rows = orjson.loads(path.read_bytes())["robots"]
        return {str(row.get("device") or row["name"]): row for row in rows}
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror}); acqd fleet writes the folder") from None
    except (orjson.JSONDecodeError, KeyError, TypeError, AttributeError):
        raise InputError(path, "is no result of acqd fleet") from None
