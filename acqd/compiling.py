"""Compiles C sources to shared libraries and keeps them in a cache."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from acqd.c_builds import CBuild
from acqd.errors import OperationError

PREBUILT = Path(__file__).with_name("prebuilt")
"""Libraries that a wheel brings along."""
NO_COMPILER = "no C compiler found (cc, gcc, clang): install one (apt-get install gcc)"


def system_compiler() -> str | None:
    """Path of this machine's C compiler: $CC, cc, gcc or clang; None without one."""
    names = [os.environ.get("CC"), "cc", "gcc", "clang"]
    return next((path for name in names if name and (path := shutil.which(name))), None)


def cache_folder() -> Path:
    """Where compiled code is kept: $XDG_CACHE_HOME/acqd, or ~/.cache/acqd."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "acqd"


def compile_shared(
    command: Sequence[str],
    arguments: Sequence[str],
    out: Path,
    *,
    environment: dict[str, str] | None = None,
    what: str = "",
) -> None:
    """Run `command arguments -o out`. Raises OperationError with the compiler's first complaint about `what`."""
    call = [*command, *arguments, "-o", str(out), "-lm"]
    done = subprocess.run(call, capture_output=True, text=True, check=False, env=environment)
    if done.returncode or not out.exists():
        lines = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
        raise OperationError(f"{command[0]} cannot compile {what or out.name}: {lines[0] if lines else 'no message'}")


def file_name(build: CBuild) -> str:
    """Name of the compiled file, with a hash of source and flags: another version has another file."""
    digest = hashlib.sha256(build.source.read_bytes() + " ".join(build.flags).encode()).hexdigest()[:16]
    return f"{build.name}-{digest}.so"


def cached_library(build: CBuild) -> Path:
    """Path of the compiled library: from the wheel, from the cache, or by the system's compiler, once.

    Raises OperationError without a compiler, for a cache that is not writable, and for C that does not compile.
    """
    name = file_name(build)
    path = cache_folder() / name
    for existing in (PREBUILT / name, path):
        if existing.exists():
            return existing
    command = system_compiler()
    if command is None:
        raise OperationError(NO_COMPILER)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary_name = tempfile.mkstemp(dir=path.parent, suffix=".so")
        os.close(handle)
    except OSError as error:
        raise OperationError(f"{path.parent}: {error.strerror}; set XDG_CACHE_HOME to a folder to write in") from None
    temporary = Path(temporary_name)
    try:
        compile_shared([command], [*build.flags, str(build.source)], temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return path
