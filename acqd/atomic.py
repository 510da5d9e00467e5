"""Folders and files of results that appear complete or not at all."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from acqd.errors import OperationError, UserError

_BEGINNING = 65_536
"""Bytes of a file that show what it is."""


def require_writable(path: Path) -> None:
    """Raises UserError where this user cannot make or replace a file or folder: before the work that fills it."""
    if path.exists() and not path.is_file() and not path.is_dir():
        return  # a pipe or a device, which is written to
    parent = next(folder for folder in path.absolute().parents if folder.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise UserError(f"{path}: {parent} is not a folder that this user may write to; choose another --out")


def require_page(path: Path, option: str = "--out") -> None:
    """Raises UserError where no HTML page can be written: also for a name of another kind, which may hold data."""
    if path.suffix not in (".html", ".htm"):
        raise UserError(f"{option} {path}: a report ends in .html; choose another {option}")
    if path.is_dir():
        raise UserError(f"{option} {path}: is a folder; expected a file")
    require_writable(path)
    if not path.absolute().parent.is_dir():
        raise UserError(f"{option} {path}: folder {path.absolute().parent} does not exist; create it")


def require_free(folder: Path, mark: str, what: str) -> None:
    """Raises UserError unless a folder is absent, empty, or an earlier `what`, which holds a file `mark`."""
    require_writable(folder)
    if folder.exists() and not (folder / mark).exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} exists and is not an earlier {what}: it would be lost; choose another --out")


def require_new(path: Path, what: str) -> None:
    """Raises UserError where a file is in the place of `what`, of which there may be no other: a backup, samples."""
    if path.exists():
        raise UserError(f"{path} exists, and {what} replaces no file; choose another --out, or remove what is there")


def require_earlier(path: Path, mark: bytes, what: str) -> None:
    """Raises UserError unless a file is absent, empty, or an earlier `what`, whose beginning holds `mark`."""
    if not path.is_file():
        return
    try:
        with path.open("rb") as file:
            beginning = file.read(_BEGINNING)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); choose another file to write") from None
    if beginning and mark not in beginning:
        raise UserError(f"{path} exists and is not an earlier {what}: it would be lost; choose another file to write")


def write_table(path: Path, text: str) -> None:
    """Write a CSV table; it replaces one with the same columns only. Raises UserError, OperationError."""
    content = text.encode()
    require_earlier(path, content.partition(b"\n")[0].rstrip(), "table with these columns")
    write_complete(path, content)


@contextmanager
def complete_folder(path: Path) -> Iterator[Path]:
    """A temporary folder to write into; at the end it is renamed to `path` and replaces a folder of that name.

    Raises UserError when it cannot be made, OperationError (and leaves nothing) when it cannot be filled.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise UserError(f"{path}: cannot be made ({error.strerror}); choose another --out") from None
    try:
        yield temporary
        _open_up(temporary)
        old = path.with_name(f".{path.name}.old")
        if path.is_dir():
            shutil.rmtree(old, ignore_errors=True)
            path.rename(old)
        temporary.rename(path)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise OperationError(f"{path}: {error.strerror}; nothing was left behind") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_new(path: Path, content: bytes) -> None:
    """Write a file that does not exist, completely or not at all. Raises FileExistsError, OSError."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        _write_to_disk(temporary, content)
        give_name(temporary, path)
    finally:
        with suppress(OSError):
            temporary.unlink()


def _write_to_disk(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def give_name(temporary: Path, path: Path) -> None:
    """Rename a file to a name that no file has. Raises FileExistsError, whoever else makes the name meanwhile."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
        temporary.replace(path)
    else:
        temporary.unlink()


def private(path: str, flags: int) -> int:
    """Opens a file that others may not read (0640): the `opener` of `open` for measurements and state."""
    return os.open(path, flags, 0o640)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Writing of one file: an error of the system that knows no name, as that of a full disk, gets the file's name."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise


def replace_file(path: Path, content: bytes) -> None:
    """Replace a file: whatever happens, its content is the old or the new one. Raises OSError.

    A terminal, or a pipe that somebody reads, is written to; a pipe that nobody reads is replaced, for it would be
    waited for. A link stays one: the file that it leads to is replaced.
    """
    if path.exists() and not path.is_file() and (stream := _stream(path)) is not None:
        with os.fdopen(stream, "wb") as file:
            file.write(content)
        return
    target = path.resolve()
    temporary = target.with_name(f".{target.name}.new")
    try:
        _write_to_disk(temporary, content)
        temporary.replace(target)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        error.filename = str(path)
        raise


def _stream(path: Path) -> int | None:
    """Descriptor of a pipe, a terminal or another device; None of a pipe that nobody reads. Raises OSError."""
    try:
        stream = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        if error.errno == errno.ENXIO and path.is_fifo():
            return None
        raise
    os.set_blocking(stream, True)
    return stream


def write_complete(path: Path, content: bytes) -> None:
    """Replace a file, and make its folder. Raises OperationError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, content)
    except OSError as error:
        raise OperationError(f"{path}: {error.strerror}; the file that was there before is unchanged") from None


def _open_up(folder: Path) -> None:
    """Set the permissions that the umask allows; temporary folders and some writers are stricter."""
    umask = os.umask(0)
    os.umask(umask)
    folder.chmod(0o777 & ~umask)
    for path in folder.rglob("*"):
        path.chmod((0o777 if path.is_dir() else 0o666) & ~umask)
