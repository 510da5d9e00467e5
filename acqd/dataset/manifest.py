"""Reads the manifest of a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson

from acqd.errors import InputError, UserError


def load_manifest(dataset: Path) -> dict[str, Any]:
    """The manifest of a dataset. Raises UserError."""
    path = dataset / "manifest.json"
    try:
        manifest: dict[str, Any] = orjson.loads(path.read_bytes())
    except (FileNotFoundError, NotADirectoryError):
        what = "is not a dataset: it has no manifest.json" if dataset.exists() else "no such folder"
        raise InputError(dataset, f"{what}; acqd dataset build makes a dataset") from None
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror}); may this user read it?") from None
    except orjson.JSONDecodeError as error:
        raise UserError(f"{path} is damaged ({error}); build the dataset again") from None
    needed = {"robot", "description", "step_s", "measured", "recordings", "refused"}
    if not isinstance(manifest, dict) or not needed <= manifest.keys() or not _is_whole(manifest):
        raise UserError(f"{path} is of another version of acqd, or damaged; build the dataset again")
    return manifest


def _is_whole(manifest: dict[str, Any]) -> bool:
    """Whether what the readers of a dataset count on has the types that acqd writes."""
    step_s, entries = manifest["step_s"], manifest["recordings"]
    return (
        isinstance(step_s, int | float)
        and step_s > 0
        and isinstance(entries, list)
        and all(
            isinstance(entry, dict)
            and all(isinstance(entry.get(key), str) for key in ("name", "file"))
            and all(isinstance(entry.get(key, 0), int | float) for key in ("rows", "context_rows", "valid_s"))
            for entry in entries
        )
    )


def valid_share(manifest: dict[str, Any]) -> float:
    """Share of the recordings' rows that hold both power and joint angles."""
    rows = sum(entry["rows"] - entry.get("context_rows", 0) for entry in manifest["recordings"])
    return float(sum(entry["valid_s"] for entry in manifest["recordings"]) / (rows * manifest["step_s"]))
