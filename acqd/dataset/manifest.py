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
    if not isinstance(manifest, dict) or not needed <= manifest.keys():
        raise UserError(f"{path} is of another version of acqd, or damaged; build the dataset again")
    return manifest


def valid_share(manifest: dict[str, Any]) -> float:
    """Share of the recordings' rows that hold both power and joint angles."""
    rows = sum(entry["rows"] - entry.get("context_rows", 0) for entry in manifest["recordings"])
    return float(sum(entry["valid_s"] for entry in manifest["recordings"]) / (rows * manifest["step_s"]))
