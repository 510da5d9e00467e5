"""The system that an installation changes: this computer, or a folder that holds the files of another one."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from acqd.errors import OperationError, UserError
from acqd.installation.plan import File


class Root:
    """The system that is changed: this computer, or a folder that holds the files of another one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.live = folder == Path("/")
        self.done: list[str] = []
        """What was changed, in words."""

    def at(self, path: str) -> Path:
        """An absolute path below the root."""
        return self.folder / path.lstrip("/")

    def run(self, *command: str, needed: bool = True) -> None:
        """Run a program of the system. Raises UserError without the program, OperationError when it fails."""
        if shutil.which(command[0]) is None:
            if needed:
                raise UserError(f"{command[0]} is not here: acqd service needs systemd and its tools")
            return
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode and needed:
            reason = (result.stderr.strip().splitlines() or ["failed"])[-1]
            raise OperationError(f"{' '.join(command)}: {reason}")

    def succeeds(self, *command: str) -> bool:
        """Run a program of the system, and say whether it ended with 0."""
        return subprocess.run(command, capture_output=True, check=False).returncode == 0

    @property
    def managed(self) -> bool:
        """Whether a systemd runs here that starts units: not below another root, nor in most containers."""
        return self.live and Path("/run/systemd/system").is_dir() and shutil.which("systemctl") is not None

    def active(self, unit: str) -> bool:
        """Whether systemd runs the unit; never below another root."""
        return self.managed and self.succeeds("systemctl", "is-active", unit)

    def require_rights(self) -> None:
        """Raises UserError for a user who may not change the system, and without the root's folder."""
        if os.geteuid() != 0:
            raise UserError("acqd service changes users and system files: run it with sudo")
        if not self.folder.is_dir():
            raise UserError(f"{self.folder} is not a folder; choose another --root")

    def rooted(self, program: str, *arguments: str) -> None:
        """Run systemd-sysusers or systemd-tmpfiles on this root."""
        self.run(program, *([] if self.live else [f"--root={self.folder}"]), *arguments)

    def require_places(self, files: Iterable[File]) -> None:
        """Raises UserError where one of the files could not be written: before the first one is."""
        for file in files:
            path = self.at(file.path)
            if path.is_dir() or (path.is_symlink() and not path.exists()):
                kind = "a folder" if path.is_dir() else "a link that leads nowhere"
                raise UserError(f"{path}: is {kind}, not a file; move it away")
            folder = next(one for one in path.parents if one.exists() or one.is_symlink())
            if not folder.is_dir():
                raise UserError(f"{folder}: is no folder, but {path} belongs there; move it away")
            if not os.access(folder, os.W_OK):
                raise UserError(f"{folder} cannot be written, also not by root; is its disk mounted read-only?")

    def write(self, file: File) -> None:
        """Write a file unless it is there as wanted, or is to be kept."""
        path = self.at(file.path)
        same = path.exists() and path.read_bytes() == file.text.encode()
        if same or (file.keep and path.exists()):
            if file.path.endswith(".acl") and not same:
                self.done.append(f"kept {file.path}, which differs from the rules of this version: compare them")
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_name(f".{path.name}.new")
        with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as out:
            out.write(file.text)
        group = self.group(file.group)
        if group is not None:
            os.chown(new, 0, group)
        new.chmod(file.mode)
        new.replace(path)
        self.done.append(f"wrote {file.path}")

    def group(self, name: str) -> int | None:
        """Number of a group of this root; None for one that it has not."""
        return self._number("/etc/group", name)

    def user(self, name: str) -> int | None:
        """Number of a user of this root; None for one that it has not."""
        return self._number("/etc/passwd", name)

    def _number(self, table: str, name: str) -> int | None:
        with suppress(OSError):
            for line in self.at(table).read_text(encoding="utf-8").splitlines():
                if line.startswith(f"{name}:"):
                    return int(line.split(":")[2])
        return None

    def remove_folder(self, path: str) -> None:
        """Delete a folder with what is in it; of a link to a folder, the link. Raises OperationError."""
        folder = self.at(path)
        leads_to = folder.readlink() if folder.is_symlink() else None
        try:
            if leads_to is None:
                shutil.rmtree(folder)
            else:
                folder.unlink()
        except OSError as error:
            remedy = "does a process that somebody started by hand still write there? End it, and repeat the command"
            raise OperationError(f"{path} cannot be deleted ({error.strerror or error}): {remedy}") from None
        self.done.append(f"removed {path}")
        if leads_to is not None:
            self.done.append(f"kept {leads_to}, to which {path} led")

    def remove(self, path: str) -> None:
        """Delete a file, and its folder of drop-ins when that is empty then."""
        target = self.at(path)
        if target.exists() or target.is_symlink():
            target.unlink()
            self.done.append(f"removed {path}")
        if target.parent.name.endswith(".d"):
            with suppress(OSError):
                target.parent.rmdir()
