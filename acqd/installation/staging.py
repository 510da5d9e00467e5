"""A backup unpacked next to the places of its files, on their disks, and verified there."""

from __future__ import annotations

import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from acqd.daemon.config_file import parsed_config, read_toml
from acqd.errors import InputError, OperationError
from acqd.installation.backup import STATE
from acqd.installation.backup_file import Entry, Manifest, extract
from acqd.installation.plan import CONFIGURATION
from acqd.installation.root import Root

CONFIG = "/etc/acqd"
_OURS = (f"{CONFIG}/", f"{STATE}/")
_ALLOWED = ("/etc/mosquitto/acqd.", "/etc/mosquitto/conf.d/acqd.conf", *_OURS)
_SYSTEM = ("/etc/", "/usr/", "/bin/", "/sbin/", "/lib", "/boot/", "/root/", "/proc/", "/sys/", "/dev/")
_CERTIFICATES = (".pem", ".crt", ".key")


@dataclass(frozen=True, slots=True)
class Staging:
    """Where the files of a backup lie until they get their names."""

    root: Root
    manifest: Manifest
    stamp: str

    def place_of(self, entry: Entry) -> Path:
        """Where a file or folder lies now."""
        target = self.root.at(entry.path)
        for folder in (CONFIG, STATE):
            if target.is_relative_to(self.root.at(folder)):
                return self.beside(folder) / target.relative_to(self.root.at(folder))
        return self.beside(entry.path)

    def beside(self, place: str) -> Path:
        """A name next to a place."""
        target = self.root.at(place)
        return target.with_name(f".{target.name}.restore-{self.stamp}")

    @property
    def renamed(self) -> dict[Path, Path]:
        """Place of everything that gets another name, and where it is now: whole folders as far as possible."""
        staged = {self.root.at(entry.path): self.place_of(entry) for entry in self._elsewhere}
        staged |= {self.root.at(STATE) / one.name: one for one in children(self.beside(STATE))}
        if children(self.beside(CONFIG)):
            staged[self.root.at(CONFIG)] = self.beside(CONFIG)
        return staged

    @property
    def _elsewhere(self) -> list[Entry]:
        """Files outside of the two folders."""
        return [one for one in self.manifest.entries if one.sha256 and not one.path.startswith(_OURS)]

    @property
    def absent(self) -> list[Path]:
        """Folders that are to be made, those within others first."""
        places = [*map(self.beside, (CONFIG, STATE)), *map(self.place_of, self._elsewhere)]
        return sorted({folder for place in places for folder in place.parents if not folder.exists()}, reverse=True)

    def unpack(self, path: Path) -> None:
        """Write every file, with owner and mode. Raises InputError."""
        for folder in (CONFIG, STATE):
            self.beside(folder).parent.mkdir(parents=True, exist_ok=True)
            self.beside(folder).mkdir(mode=0o700)
        for entry in self.manifest.entries:
            if entry.sha256 is None:
                self.place_of(entry).mkdir(parents=True, exist_ok=True)
        extract(path, self.manifest, self.place_of)

    def give(self) -> None:
        """Owner, group and mode of everything; names that this system does not have become root."""
        for entry in self.manifest.entries:
            place = self.place_of(entry)
            os.chown(place, self.root.user(entry.user) or 0, self.root.group(entry.group) or 0)
            place.chmod(entry.mode & 0o777)

    def read(self, path: Path) -> dict[str, int]:
        """Use what was unpacked: parse the configuration, examine every database; the rows of each.

        Raises InputError, which names the backup.
        """
        rows = {}
        for entry in self.manifest.entries:
            if entry.path == CONFIGURATION:
                parsed_config(read_toml(self.place_of(entry)), Path(entry.path))
            if entry.path in self.manifest.databases:
                try:
                    rows[entry.path] = _rows(self.place_of(entry))
                except sqlite3.Error as error:
                    problem = f"the database {entry.path} is damaged ({error}); nothing is restored"
                    raise InputError(path, problem) from None
        return rows

    def clear(self) -> None:
        """Delete what has not got another name."""
        for folder in (CONFIG, STATE):
            shutil.rmtree(self.beside(folder), ignore_errors=True)
        for entry in self._elsewhere:
            with suppress(OSError):
                self.place_of(entry).unlink()


@contextmanager
def staged(root: Root, path: Path, manifest: Manifest, stamp: str) -> Iterator[tuple[Staging, dict[str, int]]]:
    """A backup, unpacked and verified, with the rows of its databases; what is left at the end is deleted."""
    _check_places(path, manifest)
    staging = Staging(root, manifest, stamp)
    absent = staging.absent
    try:
        staging.unpack(path)
        rows = staging.read(path)
        staging.give()
        yield staging, rows
    except OSError as error:
        raise OperationError(f"{error.filename or path}: {error.strerror}; nothing is restored") from None
    finally:
        staging.clear()
        for folder in absent:
            with suppress(OSError):  # of a restore, they hold what was restored
                folder.rmdir()


def children(folder: Path) -> list[Path]:
    """What is in a folder, which may not be there."""
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _rows(database: Path) -> int:
    """Raises sqlite3.Error for a damaged database."""
    with closing(sqlite3.connect(f"file:{database}?mode=ro&immutable=1", uri=True)) as connection:
        problem = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
        if problem != "ok":
            raise sqlite3.DatabaseError(problem)
        if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'power'").fetchone() is None:
            return 0
        return int(connection.execute("SELECT count(*) FROM power").fetchone()[0])


def _check_places(path: Path, manifest: Manifest) -> None:
    """Raises InputError for files of the system: a backup holds those of acqd, its databases and certificates."""
    for entry in manifest.entries:
        ours = entry.path in (CONFIG, STATE, *manifest.databases) or entry.path.startswith(_ALLOWED)
        if not ours and entry.path.startswith(_SYSTEM) and Path(entry.path).suffix not in _CERTIFICATES:
            raise InputError(path, f"would write {entry.path}, which is no file of acqd; nothing is restored")
