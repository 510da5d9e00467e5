"""The file of a backup: a compressed tar archive of files, and behind them a manifest with a checksum of each."""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import tarfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from acqd.atomic import give_name, require_new
from acqd.errors import InputError, OperationError, in_our_words

_MANIFEST, _FILES = "manifest.json", "files"
_CHUNK, _LARGEST_MANIFEST = 1 << 20, 64 << 20
_BROKEN = "is damaged, or no backup of acqd service backup"


def _safe(path: str) -> str:
    if not path.startswith("/") or {"..", "."} & set(path.split("/")) or "\0" in path:
        raise ValueError("expected an absolute path")
    return path


class Entry(BaseModel):
    """A file or folder, with the names of its owners: their numbers differ from computer to computer."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    path: Annotated[str, AfterValidator(_safe)]
    mode: int
    user: str
    group: str
    sha256: str | None = None
    """None: a folder."""
    size: int = 0


class Manifest(BaseModel):
    """What a backup holds, and the installation that it is of."""

    model_config = ConfigDict(extra="forbid")
    format: int = 1
    version: str
    """Of acqd."""
    made: str
    """UTC."""
    computer: str
    services: list[str]
    rights: list[str]
    archive: str | None
    """Folder of samples outside of the state folder; the samples are not in the backup."""
    broker: bool
    databases: list[str]
    """Paths of SQLite files, copied as of one moment."""
    left_out: list[str]
    """What else belongs to the installation, in words."""
    entries: list[Entry] = []


class Writer:
    """Adds files to a backup in progress."""

    def __init__(self, tar: tarfile.TarFile, manifest: Manifest) -> None:
        self._tar, self.manifest = tar, manifest

    def folder(self, entry: Entry) -> None:
        """Note a folder."""
        self.manifest.entries.append(entry)

    def file(self, entry: Entry, content: IO[bytes]) -> None:
        """Add a file with the content of a temporary copy, which nobody changes any more."""
        size = content.seek(0, os.SEEK_END)
        content.seek(0)
        digest = hashlib.file_digest(content, "sha256").hexdigest()  # type: ignore[arg-type]
        content.seek(0)
        self._add(f"{_FILES}{entry.path}", size, content)
        self.manifest.entries.append(entry.model_copy(update={"sha256": digest, "size": size}))

    def finish(self) -> None:
        """Add the manifest."""
        text = self.manifest.model_dump_json(indent=1).encode()
        self._add(_MANIFEST, len(text), io.BytesIO(text))

    def _add(self, name: str, size: int, content: IO[bytes]) -> None:
        info = tarfile.TarInfo(name)
        info.size, info.mode = size, 0o600
        self._tar.addfile(info, content)


@contextmanager
def writing(path: Path, manifest: Manifest) -> Iterator[Writer]:
    """A new file that appears complete or not at all, readable by its owner only.

    Raises UserError where the file exists: an earlier backup may be the only one that is good. Raises OperationError.
    """
    require_new(path, "a backup")
    new = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        with (
            open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as file,
            tarfile.open(fileobj=file, mode="w:gz", compresslevel=3) as tar,
        ):
            writer = Writer(tar, manifest)
            yield writer
            writer.finish()
        with new.open("rb") as written:
            os.fsync(written.fileno())
        give_name(new, path)
    except FileExistsError:
        require_new(path, "a backup")
        raise
    except OSError as error:
        raise OperationError(f"{error.filename or path}: {error.strerror}; no backup was written") from None
    finally:
        with suppress(OSError):
            new.unlink()


def manifest_of(path: Path) -> Manifest:
    """The manifest, without a look at the files. Raises InputError."""
    with _reading(path) as tar:
        for member in tar:
            if member.name == _MANIFEST and member.isreg() and member.size <= _LARGEST_MANIFEST:
                text = tar.extractfile(member)
                assert text is not None
                return _parsed(text.read(), path)
    raise InputError(path, "has no manifest: its end is missing, or it is no backup of acqd service backup")


def extract(path: Path, manifest: Manifest, place_of: Callable[[Entry], Path]) -> None:
    """Write every file to its place, and compare size and checksum. Raises InputError for what is not as it was."""
    expected = {f"{_FILES}{entry.path}": entry for entry in manifest.entries if entry.sha256 is not None}
    with _reading(path) as tar:
        for member in tar:
            if member.name == _MANIFEST:
                continue
            entry = expected.pop(member.name, None)
            if entry is None or not member.isreg():
                raise InputError(path, f"holds {member.name!r}, which its manifest does not name")
            target = place_of(entry)
            target.parent.mkdir(parents=True, exist_ok=True)
            source = tar.extractfile(member)
            assert source is not None
            with open(os.open(target, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600), "w+b") as out:
                shutil.copyfileobj(source, out, _CHUNK)
                out.flush()
                os.fsync(out.fileno())
                out.seek(0)
                digest = hashlib.file_digest(out, "sha256").hexdigest()
            if (digest, member.size) != (entry.sha256, entry.size):
                raise InputError(path, f"{entry.path} is not what was stored: another checksum; nothing is restored")
    if expected:
        raise InputError(path, f"{next(iter(expected.values())).path} is missing; nothing is restored")


@contextmanager
def _reading(path: Path) -> Iterator[tarfile.TarFile]:
    try:
        with tarfile.open(path, "r:gz") as tar:
            yield tar
    except FileNotFoundError as error:
        raise InputError(error.filename or path, "no such file; expected one of acqd service backup") from None
    except IsADirectoryError:
        raise InputError(path, "is a folder; expected a file of acqd service backup") from None
    except (tarfile.TarError, EOFError, ValueError, zlib.error) as error:
        raise InputError(path, f"{_BROKEN} ({error})") from None
    except OSError as error:  # gzip.BadGzipFile has no number
        if error.errno is None:
            raise InputError(path, f"{_BROKEN} ({error})") from None
        raise OperationError(f"{error.filename or path}: {error.strerror}; nothing is restored") from None


def _parsed(text: bytes, path: Path) -> Manifest:
    try:
        manifest = Manifest.model_validate_json(text)
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(str(part) for part in fault["loc"])
        raise InputError(path, f"its manifest cannot be understood ({where}: {in_our_words(fault['msg'])})") from None
    if manifest.format != Manifest.model_fields["format"].default:
        raise InputError(path, f"was written by a newer acqd ({manifest.version}); restore it with that version")
    return manifest
