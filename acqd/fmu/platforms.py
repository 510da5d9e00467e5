"""Platforms of an FMU. The system's compiler builds for this machine, zig for the others."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from acqd.c_builds import FMU_FALLBACK, fmu
from acqd.compiling import NO_COMPILER, cache_folder, compile_shared, system_compiler
from acqd.errors import UserError
from acqd.extras import install_command


@dataclass(frozen=True, slots=True)
class Platform:
    """A platform on which an FMU can run."""

    name: str
    """Name in --platform."""
    folders: tuple[str, str]
    """Folder of the binary in FMI 2.0 and in FMI 3.0."""
    suffix: str
    zig: str
    """Target triple of zig."""


PLATFORMS = {
    each.name: each
    for each in (
        Platform("linux64", ("linux64", "x86_64-linux"), ".so", "x86_64-linux-gnu.2.17"),
        Platform("win64", ("win64", "x86_64-windows"), ".dll", "x86_64-windows-gnu"),
        Platform("darwin64", ("darwin64", "x86_64-darwin"), ".dylib", "x86_64-macos"),
        Platform("aarch64-linux", ("aarch64-linux", "aarch64-linux"), ".so", "aarch64-linux-gnu.2.17"),
        Platform("aarch64-darwin", ("aarch64-darwin", "aarch64-darwin"), ".dylib", "aarch64-macos"),
    )
}


def here() -> str:
    """The platform of this machine."""
    system = {"win32": "win"}.get(sys.platform, sys.platform)
    if platform.machine() in ("aarch64", "arm64"):
        return f"aarch64-{system}"
    return f"{system}64"


def build(target: Platform, sources: Sequence[Path], include: Path, out: Path) -> str:
    """Compile `sources` for a platform. Returns the name of the compiler.

    Raises UserError when no compiler for the platform is installed, OperationError when the C does not compile.
    """
    command = _compiler(target)
    environment = os.environ | {"ZIG_GLOBAL_CACHE_DIR": str(cache_folder() / "zig")}
    compile_shared(fmu(target.name, sources, include), command, out, environment=environment)
    return "zig cc" if command[0] == sys.executable else command[0]


def _compiler(target: Platform) -> list[str]:
    if target.name == here():
        native = system_compiler()
        if native is not None:
            return [native]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", target.zig, "-Wl,-s"]
    if target.name == here():
        raise UserError(f"{NO_COMPILER}; otherwise {FMU_FALLBACK}")
    raise UserError(
        f"compiling for {target.name} needs zig: {install_command('fmu')}, or ask for --platform {here()} only"
    )
