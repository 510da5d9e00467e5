"""Optional libraries: which of them are missing, and what installs them."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

from acqd.errors import UserError

LOOP = ("jinja2", "matplotlib", "pyarrow", "safetensors", "scipy")
"""What the closing loop imports."""
MOTION = ("pinocchio",)
"""What looks for collisions, inverts kinematics and reads URDF imports."""


def require(what: str, modules: Sequence[str], extra: str) -> None:
    """Raises UserError unless all `modules` are installed; `what` needs them, the extra `extra` of acqd has them."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise UserError(f"{what} needs {' and '.join(missing)}: pip install 'acqd[{extra}]'")
