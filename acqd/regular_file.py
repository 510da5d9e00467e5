"""Files of acqd, opened as what they have to be: a pipe of such a name would wait for ever, a device never ends."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path


def open_regular(path: Path, most_bytes: int) -> int:
    """Descriptor of a regular file of at most `most_bytes`, for reading. Raises OSError."""
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe is opened without its writer
    try:
        status = os.fstat(file)
        if stat.S_ISDIR(status.st_mode):
            raise _error(errno.EISDIR, path)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "is a pipe, a socket or a device, and no file", str(path))
        if status.st_size > most_bytes:
            raise _error(errno.EFBIG, path)
    except OSError:
        os.close(file)
        raise
    return file


def read_regular(path: Path, most_bytes: int) -> bytes:
    """Content of a regular file of at most `most_bytes`. Raises OSError."""
    with os.fdopen(open_regular(path, most_bytes), "rb") as file:
        return file.read(most_bytes)


def _error(number: int, path: Path) -> OSError:
    return OSError(number, os.strerror(number), str(path))
