"""`acqd service restore`: a backup read and verified, then put in place; what was there is moved aside.

Everything is unpacked next to its place and verified there. Only then are names exchanged, and all of them back where
one cannot be.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from acqd.errors import OperationError, UserError
from acqd.installation.backup import SAMPLES, STATE
from acqd.installation.backup_file import Manifest, manifest_of
from acqd.installation.install import install, make_user, reload, require_broker, running
from acqd.installation.plan import Wanted, require_reachable
from acqd.installation.present import present_in
from acqd.installation.root import Root
from acqd.installation.staging import CONFIG, Staging, children, staged


@dataclass(frozen=True, slots=True)
class Verified:
    """What a backup holds, read and compared."""

    manifest: Manifest
    rows: dict[str, int]
    """Rows of every database, counted."""


def verify(root: Root, path: Path) -> Verified:
    """Read the whole backup: checksums, configuration, databases. Raises InputError."""
    root.require_rights()
    manifest = manifest_of(path)
    with staged(root, path, manifest, _stamp()) as (_, rows):
        return Verified(manifest, rows)


def restore(root: Root, path: Path, program: str, *, overwrite: bool) -> Verified:
    """Put a backup in place, and install the services that it is of.

    `overwrite`: services that run are stopped, and what is there is moved aside (`.before-DATE`); nothing is deleted.
    Raises UserError or InputError before anything is changed, OperationError with everything as it was.
    """
    root.require_rights()
    if root.live:
        require_reachable(program)
    manifest = manifest_of(path)
    if manifest.broker:
        require_broker(root)
    units = running(root, present_in(root.at).services)
    there = [place for place in (CONFIG, STATE) if children(root.at(place))]
    if (there or units) and not overwrite:
        raise UserError(
            f"{' and '.join([*there, *units])}: there already; --yes stops what runs and moves what is there aside"
        )
    make_user(Wanted(program, archive=manifest.archive), root)
    with staged(root, path, manifest, _stamp()) as (staging, rows):
        try:
            for unit in units:
                root.run("systemctl", "stop", unit)
            root.done += _exchange(staging)
        except OperationError:
            for unit in units:
                root.run("systemctl", "start", unit, needed=False)
            raise
    if manifest.services:
        archive = manifest.archive if manifest.archive == present_in(root.at).configured_archive else None
        wanted = Wanted(program, tuple(manifest.services), None, tuple(manifest.rights), archive, manifest.broker)
        install(wanted, root, start=False)
    if root.managed:
        reload(root)
    for unit in units:
        root.run("systemctl", "start", unit)
        root.done.append(f"started {unit}")
    return Verified(manifest, rows)


def _exchange(staging: Staging) -> list[str]:
    """Give everything its name; returns what was done. Raises OperationError, and then nothing has changed."""
    state = staging.root.at(STATE)
    renamed = staging.renamed
    old = [path for path in children(state) if not path.name.startswith(SAMPLES)]
    old += [path for target in renamed for path in (target, *_journals(target)) if path.exists()]
    aside = {path: _aside(path, state, staging.stamp) for path in dict.fromkeys(old)}
    moved: list[tuple[Path, Path]] = []
    try:
        for source, target in [*aside.items(), *((source, target) for target, source in renamed.items())]:
            target.parent.mkdir(mode=0o750, parents=True, exist_ok=True)
            source.rename(target)
            moved.append((source, target))
    except OSError as error:
        stuck = [str(target) for source, target in reversed(moved) if not _renamed(target, source)]
        state_now = f"still to be renamed by hand: {', '.join(stuck)}" if stuck else "everything is as it was"
        raise OperationError(f"{error.filename}: {error.strerror}; {state_now}") from None
    return [f"moved {path} to {place}" for path, place in aside.items()] + [f"restored {path}" for path in renamed]


def _renamed(source: Path, target: Path) -> bool:
    try:
        source.rename(target)
    except OSError:
        return False
    return True


def _aside(path: Path, state: Path, stamp: str) -> Path:
    """Where something that is there goes; all of the state folder together."""
    if path.parent == state:
        return state.with_name(f"{state.name}.before-{stamp}") / path.name
    return path.with_name(f"{path.name}.before-{stamp}")


def _journals(path: Path) -> list[Path]:
    """Files that SQLite keeps next to a database, and that belong to the earlier one."""
    return [path.with_name(f"{path.name}{end}") for end in ("-wal", "-shm", "-journal")]


def _stamp() -> str:
    return f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
