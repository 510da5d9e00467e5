"""Configuration files and units that come with acqd: in a wheel below acqd/share, in a checkout next to the package."""

from __future__ import annotations

from pathlib import Path

from acqd.errors import UserError

_PACKAGE = Path(__file__).parents[1]


def shared_text(name: str) -> str:
    """Contents of a file such as `systemd/acqd.service`. Raises UserError where acqd was copied without them."""
    for folder in (_PACKAGE / "share", _PACKAGE.parent):
        path = folder / name
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise UserError(f"{name} is not next to acqd in {_PACKAGE}; install acqd from its wheel or run its checkout")
