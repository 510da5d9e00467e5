"""Optional libraries: which of them are missing, and what installs them."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from acqd.errors import UserError

LOOP = ("jinja2", "matplotlib", "safetensors", "scipy")
"""What the closing loop imports."""
MOTION = ("pinocchio",)
"""What looks for collisions, inverts kinematics and reads URDF imports."""


def require(what: str, modules: Sequence[str], extra: str) -> None:
    """Raises UserError unless all `modules` are installed; `what` needs them, the extra `extra` of acqd has them."""
    missing = [name for name in modules if not present([name])]
    if missing:
        raise UserError(f"{what} needs {' and '.join(missing)}: {install_command(extra)}")


def present(modules: Sequence[str]) -> bool:
    """Whether all of them are installed."""
    return all(find_spec(name) is not None for name in modules)


def install_command(extra: str) -> str:
    """What installs the libraries of an extra into this environment.

    The path of pip is named where the shell's own would install into another environment.
    """
    path = Path(sys.prefix) / "bin" / "pip"
    own = sys.prefix == sys.base_prefix or os.environ.get("VIRTUAL_ENV") == sys.prefix or not path.exists()
    return f"{'pip' if own else path} install 'acqd[{extra}]'"
