"""What a dataset holds that a build is to put more recordings into, and the safe way to put them there."""

from __future__ import annotations

import fcntl
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acqd.atomic import complete_folder, require_writable, write_complete
from acqd.dataset.config import BuildConfig
from acqd.dataset.manifest import load_manifest
from acqd.errors import OperationError, UserError
from acqd.robot.description import RobotDescription

MANIFEST = "manifest.json"


@dataclass(frozen=True, slots=True)
class Existing:
    """The dataset before the build; empty for a new one."""

    manifest: dict[str, Any] = field(default_factory=dict)
    content: bytes = b""
    """Of the manifest's file."""

    @property
    def names(self) -> list[str]:
        """Names of the recordings and of the logs they come from."""
        recordings = self.manifest.get("recordings", [])
        return [entry["name"] for entry in recordings] + [Path(entry["log"]["path"]).stem for entry in recordings]

    @property
    def logs(self) -> dict[str, str]:
        """Recordings by the hash of their log."""
        return {entry["log"]["sha256"]: entry["name"] for entry in self.manifest.get("recordings", [])}


def existing(config: BuildConfig, robot: RobotDescription) -> Existing:
    """The dataset `config.out` if recordings are to be put into it. Raises UserError where that cannot be done."""
    if not config.append:
        if config.out.exists():
            raise UserError(f"{config.out} exists; choose another --out, remove it, or put more into it with --append")
        require_writable(config.out)
        return Existing()
    manifest = load_manifest(config.out)
    content = (config.out / MANIFEST).read_bytes()
    if manifest["robot"] != robot.name:
        raise UserError(f"{config.out} holds recordings of {manifest['robot']}, not of {robot.name}")
    if abs(manifest["step_s"] - config.step_s) > 1e-9:
        raise UserError(f"{config.out} has rows of {manifest['step_s']} s, not of {config.step_s} s; leave --step out")
    return Existing(manifest, content)


def write_new(out: Path, manifest: bytes, fill: Callable[[Path], None]) -> None:
    """A new dataset: `fill` writes the recordings and the report into a folder. Raises UserError, OperationError."""
    with complete_folder(out) as folder:
        fill(folder)
        (folder / MANIFEST).write_bytes(manifest)


def write_more(out: Path, before: Existing, manifest: bytes, version: int, fill: Callable[[Path], None]) -> None:
    """Further recordings: their files first, the manifest that names them last and at once.

    Whoever reads meanwhile sees the dataset as it was. Raises UserError when the dataset has changed since it was
    read, OperationError (and leaves the dataset as it was) when it cannot be written.
    """
    with _lock(out):
        if (out / MANIFEST).read_bytes() != before.content:
            raise UserError(f"{out}: another build has put recordings into it meanwhile; run this one again")
        moved: list[Path] = []
        try:
            with tempfile.TemporaryDirectory(prefix=".new.", dir=out, ignore_cleanup_errors=True) as temporary:
                new = Path(temporary)
                fill(new)
                for file in [*sorted((new / "recordings").iterdir()), *new.glob("report.html")]:
                    name = f"report-{version}.html" if file.parent == new else f"recordings/{file.name}"
                    moved += [file.rename(out / name)]
            write_complete(out / MANIFEST, manifest)
        except BaseException as error:
            for path in moved:
                with suppress(OSError):
                    path.unlink()
            if isinstance(error, OSError):
                raise OperationError(f"{out}: {error.strerror}; the dataset is as it was") from None
            raise


@contextmanager
def _lock(out: Path) -> Iterator[None]:
    """Keeps other builds from writing into the dataset. Raises UserError when one is writing, or nobody may write."""
    try:
        with (out / ".lock").open("w") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
    except BlockingIOError:
        raise UserError(f"{out}: another build is putting recordings into it; run this one when that is done") from None
    except PermissionError as error:
        raise UserError(f"{out}: cannot be written ({error.strerror})") from None
