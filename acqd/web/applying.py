"""Puts a proposed model in the place of the sidecar's, after a confirmation with a name; the old one is kept."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import time
from pathlib import Path
from typing import Any

import orjson

from acqd.errors import UserError

LOG = "applied.jsonl"
"""Beside the jobs: one line per model that was put in place."""
_NAME = re.compile(r"[^\x00-\x1f\x7f]{2,80}")


def apply(proposal: Path, model: Path, log: Path, name: str, address: str) -> dict[str, Any]:
    """Copy the bundle `proposal` to `model`, keep the old bundle next to it, and write who did so to `log`.

    The line is written before anything is moved. Raises UserError.
    """
    if not _NAME.fullmatch(name.strip()):
        raise UserError("type your name: 2 to 80 characters")
    if not (proposal / "bundle.json").is_file() or not _changed(proposal.parent / "report.json"):
        raise UserError("this search proposes no other model: nothing was added")
    if model.is_symlink() or not (model / "bundle.json").is_file():
        raise UserError(f"{model} is not the folder of a bundle; nothing was replaced")
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    kept, new = model.with_name(f"{model.name}.before-{stamp}"), model.with_name(f".{model.name}.new-{stamp}")
    line = {
        "time": stamp, "name": name.strip(), "address": address, "model": str(model), "kept": str(kept),
        "proposal": str(proposal), "sha256_before": _digest(model), "sha256_after": _digest(proposal),
    }  # fmt: skip
    try:
        shutil.copytree(proposal, new)
        _write_line(log, line)
        model.rename(kept)
        new.rename(model)
    except OSError as error:
        shutil.rmtree(new, ignore_errors=True)
        if kept.exists() and not model.exists():
            kept.rename(model)
        raise UserError(f"{model} could not be replaced ({error.strerror}); the model is as before") from None
    return line


def applied(log: Path) -> list[dict[str, Any]]:
    """The newest entries of the log, newest first; lines that are no JSON are left out."""
    try:
        lines = log.read_bytes().splitlines()[-5:]
    except OSError:
        return []
    entries = []
    for text in reversed(lines):
        try:
            entries.append(orjson.loads(text))
        except orjson.JSONDecodeError:
            continue
    return entries


def _changed(report: Path) -> bool:
    """Whether the search has added an effect or a correction."""
    try:
        found = orjson.loads(report.read_bytes())
        return bool(found.get("correction")) or any(effect.get("added") for effect in found["effects"])
    except (OSError, orjson.JSONDecodeError, KeyError, TypeError, AttributeError):
        return False


def _digest(bundle: Path) -> str:
    return hashlib.sha256((bundle / "bundle.json").read_bytes()).hexdigest()


def _write_line(log: Path, line: dict[str, Any]) -> None:
    with log.open("ab") as file:
        file.write(orjson.dumps(line) + b"\n")
        file.flush()
        os.fsync(file.fileno())
