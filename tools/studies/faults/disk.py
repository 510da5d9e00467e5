"""Disks so small that a fault can fill them: ext4 in a file, mounted where only this process and its children see it.

That takes root and a free loop device. Nothing stays mounted when the process has ended.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import shutil
import struct
import subprocess
import time
from contextlib import suppress
from pathlib import Path

from acqd.errors import OperationError

_NEW_MOUNTS = 0x0002_0000  # CLONE_NEWNS
_BLOCK = 4096
_RELEASED_S = 120.0
"""How long killed processes may keep files open: those of a database end one after another."""
_SHUTDOWN, _WITHOUT_JOURNAL = 0x8004587D, 2
"""EXT4_IOC_SHUTDOWN with EXT4_GOING_FLAGS_NOLOGFLUSH (fs/ext4/ext4.h)."""


def missing() -> str:
    """Why this computer cannot have small disks, else empty."""
    if os.geteuid() != 0:
        return "mounting needs root"
    if not Path("/dev/loop-control").exists() or shutil.which("mkfs.ext4", path=_PATH) is None:
        return "a loop device and mkfs.ext4 are needed"
    return ""


_PATH = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"


def own_mounts() -> None:
    """Give this thread, and what it starts, a mount table of its own. Raises OperationError."""
    if ctypes.CDLL(None, use_errno=True).unshare(_NEW_MOUNTS):
        raise OperationError(f"no mount table for the disks: {os.strerror(ctypes.get_errno())}")
    _run("mount", "--make-rprivate", "/")


class SmallDisk:
    """A file system of some megabytes in a folder."""

    def __init__(self, folder: Path, megabytes: int) -> None:
        """Makes and mounts it; call `own_mounts` before. Raises OperationError."""
        self._folder, image = folder, folder.with_name(f"{folder.name}.img")
        self._image = image
        folder.mkdir(exist_ok=True)
        with image.open("wb") as file:
            file.truncate(megabytes << 20)
        _run("mkfs.ext4", "-q", "-m", "0", "-F", str(image))
        _run("mount", "-o", "loop", str(image), str(folder))
        self._ballast = folder / "ballast"

    def fill(self) -> None:
        """Leave no block free."""
        size = 1 << 30
        with self._ballast.open("wb") as file:
            while size >= _BLOCK:
                try:
                    os.posix_fallocate(file.fileno(), file.seek(0, os.SEEK_END), size)
                except OSError:
                    size //= 2

    def free(self) -> None:
        """Make room again."""
        self._ballast.unlink(missing_ok=True)

    def cut(self) -> None:
        """As a power cut: from now on nothing reaches the image, the journal's memory included."""
        folder = os.open(self._folder, os.O_RDONLY)
        try:
            fcntl.ioctl(folder, _SHUTDOWN, struct.pack("I", _WITHOUT_JOURNAL))
        finally:
            os.close(folder)

    def mount_again(self) -> None:
        """After a cut, once no process has a file open there: the journal on the image is replayed."""
        deadline = time.monotonic() + _RELEASED_S
        while True:
            try:
                _run("umount", str(self._folder))
                break
            except OperationError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.05)
        _run("mount", "-o", "loop", str(self._image), str(self._folder))

    def unmount(self) -> None:
        """Detach it; the image stays."""
        with suppress(OperationError):
            _run("umount", "--lazy", str(self._folder))


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | {"PATH": _PATH})
    if done.returncode:
        raise OperationError(f"{' '.join(command)}: {done.stderr.strip()}")
