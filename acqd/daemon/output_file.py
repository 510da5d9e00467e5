"""Output files that appear under their name only when everything has been written."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from acqd.atomic import require_earlier
from acqd.errors import UserError

_ROW = b'{"device":'
"""What every line begins with: rows, values of power quality, events, phasors."""


@contextmanager
def output_file(path: Path) -> Iterator[BinaryIO]:
    """A binary stream of JSON lines to `path`; `-` is stdout. An earlier file of such lines is replaced, no other one.

    Raises UserError and leaves no file when it cannot be written.
    """
    if str(path) == "-":
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
        return
    path = path.resolve()  # a link stays a link
    require_earlier(path, _ROW, "file of rows")
    if path.exists() and not path.is_file():  # a pipe or device is written to, never replaced
        try:
            with path.open("wb") as stream:
                yield stream
        except OSError as error:
            raise UserError(f"{path}: cannot be written ({error.strerror}); choose another file") from None
        return
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror}); choose another file") from None
    try:
        with os.fdopen(handle, "wb", buffering=1 << 20) as file:
            yield file
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise UserError(f"{path}: cannot be written ({error.strerror}); nothing was left behind") from None
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
