"""Shared libraries of a model's C: by the system's compiler for this machine, by zig for others."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from acqd.errors import OperationError, UserError

_FLAGS = ("-std=c99", "-O3", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-g0")


@dataclass(frozen=True, slots=True)
class Platform:
    """Where an FMU is to run."""

    name: str
    """As users write it."""
    folders: tuple[str, str]
    """Of the binary in FMI 2.0 and in FMI 3.0."""
    suffix: str
    zig: str
    """Target triple."""


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
    """Compile; the compiler that did it. Raises UserError for a compiler that is absent, OperationError."""
    command = _compiler(target)
    done = subprocess.run(
        [*command, *_FLAGS, f"-I{include}", *map(str, sources), "-o", str(out), "-lm"],
        capture_output=True, text=True, check=False, env=os.environ | {"ZIG_GLOBAL_CACHE_DIR": str(_zig_cache())},
    )  # fmt: skip
    if done.returncode or not out.exists():
        lines = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines() or ["silent"]
        raise OperationError(f"{command[0]} cannot compile the model for {target.name}: {lines[0]}")
    return " ".join(command[:1] if command[0] != sys.executable else ["zig cc"])


def _compiler(target: Platform) -> list[str]:
    if target.name == here():
        names = [os.environ.get("CC"), "cc", "gcc", "clang"]
        native = next((found for name in names if name and (found := shutil.which(name))), None)
        if native is not None:
            return [native]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", target.zig, "-Wl,-s"]
    if target.name == here():
        raise UserError("no C compiler found (cc, gcc, clang): install one (apt-get install gcc) or acqd[fmu]")
    raise UserError(f"compiling for {target.name} needs zig: install acqd[fmu], or ask for --platform {here()} only")


def _zig_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "acqd" / "zig"
