"""Compiles C to shared libraries and keeps them in a cache: the one way from a `CBuild` to a file."""

from __future__ import annotations

import ctypes
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
    build: CBuild, command: Sequence[str], out: Path, *, environment: dict[str, str] | None = None
) -> None:
    """Compile `build` to the file `out`. Raises OperationError with the compiler's first complaint."""
    call = [*command, *build.arguments, "-o", str(out), "-lm"]
    done = subprocess.run(call, capture_output=True, text=True, check=False, env=environment)
    if done.returncode or not out.exists():
        lines = [line for line in done.stderr.splitlines() if "error" in line] or done.stderr.splitlines()
        raise OperationError(f"{command[0]} cannot compile {build.name}: {lines[0] if lines else 'no message'}")


def file_name(build: CBuild) -> str:
    """Name of the compiled file, with a hash of sources, headers and flags: another version has another file."""
    digest = hashlib.sha256(" ".join(build.flags).encode())
    for source in (*build.sources, *build.headers):
        digest.update(source.read_bytes())
    return f"{build.name}-{digest.hexdigest()[:16]}.so"


def existing_library(build: CBuild) -> Path | None:
    """Path of the compiled library: from the wheel, or from the cache; None before it is compiled."""
    name = file_name(build)
    return next((path for path in (PREBUILT / name, cache_folder() / name) if path.exists()), None)


def why_unavailable(build: CBuild) -> str | None:
    """Why there is no compiled library, and what is done instead; None where one exists or can be compiled."""
    if existing_library(build) is not None or system_compiler() is not None:
        return None
    return f"{NO_COMPILER}; otherwise {build.fallback}"


def cached_library(build: CBuild) -> Path:
    """Path of the compiled library: from the wheel, from the cache, or by the system's compiler, once.

    Raises OperationError without a compiler, for a cache that is not writable, and for C that does not compile.
    """
    existing = existing_library(build)
    if existing is not None:
        return existing
    path = cache_folder() / file_name(build)
    command = system_compiler()
    if command is None:
        raise OperationError(f"{NO_COMPILER}; otherwise {build.fallback}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary_name = tempfile.mkstemp(dir=path.parent, suffix=".so")
        os.close(handle)
    except OSError as error:
        raise OperationError(f"{path.parent}: {error.strerror}; set XDG_CACHE_HOME to a folder to write in") from None
    temporary = Path(temporary_name)
    try:
        compile_shared(build, [command], temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def loaded_library(build: CBuild) -> ctypes.CDLL:
    """The compiled library. Raises OperationError as `cached_library`, and for a file that is damaged."""
    path = cached_library(build)
    try:
        return ctypes.CDLL(str(path))
    except OSError:
        raise OperationError(f"{path} is damaged: remove it, and it is compiled again") from None
