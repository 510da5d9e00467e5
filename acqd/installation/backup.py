"""`acqd service backup`: configuration, passwords, spool, registers and databases of an installation in one file.

The services may run. What is copied first may be overtaken by what is copied last, never the other way: a row leaves
the spool after it is in the database (ADR 14), so the spool comes before the database; a row in both is stored once.
"""

from __future__ import annotations

import shutil
import socket
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import IO

from acqd.daemon.config import Config
from acqd.daemon.config_file import load_config
from acqd.errors import OperationError, UserError
from acqd.installation.backup_file import Entry, Manifest, Writer, writing
from acqd.installation.plan import CONFIGURATION
from acqd.installation.present import present_in
from acqd.installation.root import Root

STATE = "/var/lib/acqd"
_FOLDERS = ("/etc/acqd", STATE)
_BROKER_FILES = ("/etc/mosquitto/acqd.acl", "/etc/mosquitto/acqd.passwords", "/etc/mosquitto/conf.d/acqd.conf")
_SQLITE = b"SQLite format 3\0"
SAMPLES = "archive-"
"""Beginning of the name of a folder of samples in the state folder: gigabytes, which a backup leaves out."""


def back_up(root: Root, path: Path) -> Manifest:
    """Write a backup of what is installed below `root`. Raises UserError, OperationError; then there is no new file."""
    root.require_rights()
    present = present_in(root.at)
    if not present.services and not present.configured:
        raise UserError(f"nothing of acqd is installed below {root.folder}: there is nothing to back up")
    if not path.parent.is_dir():
        raise UserError(f"{path.parent} is no folder; choose another place for the backup")
    config = load_config(root.at(CONFIGURATION)) if present.configured else Config()
    bridges = {name for name in present.services if name.startswith("bridge-")}  # they share a unit
    manifest = Manifest(
        version=metadata.version("acqd"), made=f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}", computer=socket.gethostname(),
        services=[name for name in present.services if name in present.enabled or name not in bridges],
        rights=list(present.drop_ins), archive=present.archive, broker=bool(present.broker), databases=[], left_out=[],
    )  # fmt: skip
    with writing(path, manifest) as writer:
        databases = _files(writer, root, config)
        for database in databases:
            with tempfile.TemporaryFile(dir=path.parent) as copy:
                _snapshot(database, copy)
                writer.file(_entry(root, database), copy)
                manifest.databases.append(_place(root, database))
    return manifest


def _files(writer: Writer, root: Root, config: Config) -> list[Path]:
    """Add everything but the databases, which are returned."""
    databases = []
    for path in _belonging(writer.manifest, root, config):
        if path.is_dir():
            writer.folder(_entry(root, path))
        elif _is_sqlite(path):
            databases.append(path)
        elif not (path.name.endswith(("-wal", "-shm")) and _is_sqlite(path.with_name(path.name[:-4]))):
            with suppress(FileNotFoundError), tempfile.TemporaryFile(dir=root.at("/var/lib")) as copy:
                with path.open("rb") as source:  # a segment of the spool whose rows are stored goes in between
                    shutil.copyfileobj(source, copy)
                writer.file(_entry(root, path), copy)
    return databases


def _belonging(manifest: Manifest, root: Root, config: Config) -> Iterator[Path]:
    """Folders and files, in the order of copying."""
    named: list[Path] = [*config.mqtt.certificates, *(p for p in (config.mqtt.key_file,) if p)]
    database = config.sink.database
    if "://" in database:
        manifest.left_out.append("the database is on a server: back it up there, for instance with pg_dump")
    else:
        named.append(Path(database))
    if config.archive.enabled:
        manifest.left_out.append("the samples of [archive], which are gigabytes: copy their folder")
    yield from (path for name in _BROKER_FILES if (path := root.at(name)).is_file())
    for folder in (root.at(name) for name in _FOLDERS):
        yield from _below(folder, manifest)
    for path in (one if one.is_relative_to(root.folder) else root.at(str(one)) for one in named if one.is_absolute()):
        inside = any(path.is_relative_to(root.at(folder)) for folder in _FOLDERS)
        if not inside and path.is_file():
            yield path


def _below(folder: Path, manifest: Manifest) -> Iterator[Path]:
    if not folder.is_dir():
        return
    yield folder
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink():
            if not path.name.startswith(SAMPLES):
                yield from _below(path, manifest)
        elif path.is_file():
            yield path
        elif path.is_symlink():
            manifest.left_out.append(f"{path} is a link to {path.readlink()}")


def _is_sqlite(path: Path) -> bool:
    with suppress(OSError), path.open("rb") as file:
        return file.read(len(_SQLITE)) == _SQLITE
    return False


def _snapshot(database: Path, copy: IO[bytes]) -> None:
    """The database as of one moment, although others write (SQLite's online backup). Raises OperationError."""
    try:
        with tempfile.TemporaryDirectory(dir=database.parent) as folder:
            target = Path(folder) / "copy"
            with (
                closing(sqlite3.connect(f"file:{database}?mode=rw", uri=True, timeout=30)) as source,
                closing(sqlite3.connect(target)) as into,
            ):
                source.backup(into)
                into.execute("PRAGMA journal_mode=DELETE")
            with target.open("rb") as file:
                shutil.copyfileobj(file, copy)
    except sqlite3.Error as error:
        raise OperationError(f"{database}: {error}; no backup was written") from None


def _entry(root: Root, path: Path) -> Entry:
    status = path.stat()
    return Entry(
        path=_place(root, path), mode=status.st_mode & 0o7777,
        user=_name(root, "/etc/passwd", status.st_uid), group=_name(root, "/etc/group", status.st_gid),
    )  # fmt: skip


def _place(root: Root, path: Path) -> str:
    """The path as the system below the root has it."""
    return f"/{path.relative_to(root.folder)}"


def _name(root: Root, table: str, number: int) -> str:
    with suppress(OSError):
        for line in root.at(table).read_text(encoding="utf-8").splitlines():
            fields = line.split(":")
            if fields[2:3] == [str(number)]:
                return fields[0]
    return str(number)


def default_name() -> Path:
    """A name in the folder of the command, with computer and date."""
    return Path(f"acqd-{socket.gethostname()}-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.tar.gz")
