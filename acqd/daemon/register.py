"""The energy registers on disk, so that W continues after a restart."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import stat
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from acqd.metering.registers import Registers
from acqd.regular_file import read_regular
from acqd.retry import Backoff
from acqd.uptime import start_id

_log = logging.getLogger(__name__)
_BLOCK = 4096
"""Bytes of a block of the disk."""
_MOST_BYTES = 1 << 20
"""A register file has a few kilobytes."""
_UNUSABLE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)
"""What a file makes json and the conversions of its numbers raise, whoever has written it."""
_JUST_S = 5.0
"""Age of the readings of a run that was killed and is started again, written once a second [s]."""
_PATIENCE_S = 5.0
"""How long a start waits for a disk that does not give the register out."""


@dataclass(frozen=True, slots=True)
class Run:
    """The run of the daemon that has written a register file."""

    boot: str
    seq: int
    """Of the last window in the readings; -1: none yet."""
    closed: bool = False
    """Whether the run has ended with these readings."""
    start: str = field(default_factory=lambda: start_id().hex())
    """Of the computer (`acqd.uptime`)."""
    unconfirmed: bool = False
    """Whether W may have gone back, and no row that says so has left: the power may fail twice."""

    @property
    def cut_off(self) -> bool:
        """Whether the computer has been started since without an end of the run: rows may have left that no disk has.

        A process that is killed loses nothing: what it has written is read back. Where the id of the computer's start
        is hidden, it may have been started.
        """
        return not self.closed and (self.start != start_id().hex() or not any(start_id()))


class RegisterFile:
    """One small JSON file per device, replaced atomically."""

    def __init__(self, folder: Path, device: str) -> None:
        self._path = folder / f"energy-{device}.json"
        self.trouble = ""
        """Why the file cannot be written, else empty."""
        self.others: Any = None
        """State of the registers besides energy, as JSON; None before `load`, or where there are none."""
        self.refused = False
        """Whether `load` has found a file that it could not use."""

    def last_run(self) -> Run | None:
        """Who has written the file; None: nobody, or an earlier acqd. Does not wait for a disk."""
        try:
            run = json.loads(read_regular(self._path, _MOST_BYTES))["run"]
            unconfirmed = bool(run.get("unconfirmed"))
            return Run(str(run["boot"]), int(run["seq"]), bool(run["closed"]), str(run["start"]), unconfirmed)
        except (OSError, *_UNUSABLE):
            return None

    def unfinished(self) -> Run | None:
        """The last run, if rows may have left whose energy no disk has; else None.

        Its power was cut; or it has not ended and its last readings are not of just before this start: then the disk
        took nothing at the end, or the start is late, and a question costs little.
        """
        run = self.last_run()
        if run is None or run.closed:
            return None
        with contextlib.suppress(OSError):
            if not run.cut_off and abs(time.time() - self._path.stat().st_mtime) < _JUST_S:
                return None
        return run

    def load(self, phases: int) -> list[tuple[float, float]] | None:
        """Each phase's (imported, exported) [kWh]; None: start from zero."""
        try:
            data = json.loads(self._read())
            pairs = [(float(pair["import_kWh"]), float(pair["export_kWh"])) for pair in data["phases"]]
            others = data.get("registers")
        except FileNotFoundError:
            return None
        except (OSError, *_UNUSABLE) as error:
            self._refuse(f"unreadable ({error})")
            return None
        if len(pairs) != phases:
            self._refuse(f"of {len(pairs)} phases, now there are {phases}")
            return None
        if not all(0 <= reading < 1e15 for pair in pairs for reading in pair):
            self._refuse("holding impossible readings")
            return None
        self.others = others
        return pairs

    def _read(self) -> bytes:
        """The content of the file; a disk that does not give it out at once is asked again. Raises OSError."""
        backoff, ends = Backoff(), time.monotonic() + _PATIENCE_S
        while True:
            try:
                return read_regular(self._path, _MOST_BYTES)
            except FileNotFoundError:
                raise
            except OSError:
                pause = backoff.pause_s()
                if time.monotonic() + pause > ends:
                    raise
                time.sleep(pause)

    def _refuse(self, reason: str) -> None:
        """Rename the unusable file instead of deleting it: its readings may be wanted back."""
        self.refused = True
        kept = self._path.with_suffix(".old")
        with contextlib.suppress(OSError):
            os.replace(self._path, kept)
        _log.error("%s is %s: energy starts from zero, the file is kept as %s", self._path, reason, kept.name)

    def save(
        self,
        readings: list[tuple[float, float]],
        others: Any = None,
        run: Run | None = None,
        *,
        first: bool = False,
    ) -> None:
        """Write the readings; a full disk is logged once, never fatal. May run in a thread.

        `first`: of a run, before its first row. After a power cut, the file has to say that this run was there.
        """
        data = {
            "registers": others,
            "run": asdict(run) if run is not None else None,
            "phases": [{"import_kWh": imported, "export_kWh": exported} for imported, exported in readings],
        }
        try:
            self._write(json.dumps(data).encode())
            if first:
                self._confirm_names()
        except OSError as error:
            if not self.trouble:
                _log.error("%s cannot be written: %s", self._path, error.strerror)
            self.trouble = f"{self._path} cannot be written: {error.strerror}"
        else:
            self.trouble = ""

    def _write(self, content: bytes) -> None:
        """Write into the blocks of the file before last, which then changes its name with the last one.

        A full disk takes that too: from the second time on, nothing new is allocated. A power cut between the names
        leaves one of the two complete. What somebody else has a name for (a backup of hard links) is not written over.
        Raises OSError.
        """
        spare, last = self._path.with_suffix(".new"), self._path.with_suffix(".last")
        # On the disk, these blocks may still have the name of the last file: a cut would leave them half written.
        self._confirm_names()
        if not _ours_alone(spare):
            spare.unlink(missing_ok=True)
        file = os.open(spare, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o640)
        try:
            padded = content.ljust(-(-len(content) // _BLOCK) * _BLOCK)
            os.pwrite(file, padded, 0)
            os.ftruncate(file, len(padded))
            os.fsync(file)
        finally:
            os.close(file)
        last.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # the first time, or a file system without links: allocated anew then
            os.link(self._path, last)
        os.replace(spare, self._path)
        with contextlib.suppress(FileNotFoundError):
            os.replace(last, spare)

    def _confirm_names(self) -> None:
        """Wait until the disk has the names of the files, where its file system can say so: network shares may not."""
        with contextlib.suppress(OSError):
            folder = os.open(self._path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


def _ours_alone(path: Path) -> bool:
    """Whether it is a file that we may write to, with this name only.

    It is not where it is a link or a pipe, where a backup by hard links has it, and where another user has made it: an
    `acqd run` by root, say.
    """
    try:
        status = path.lstat()
    except FileNotFoundError:
        return True
    return stat.S_ISREG(status.st_mode) and status.st_nlink <= 1 and os.access(path, os.W_OK | os.R_OK)


def greater(
    one: list[tuple[float, float]] | None, other: list[tuple[float, float]] | None, phases: int
) -> list[tuple[float, float]] | None:
    """The greater reading of every register [kWh], for they only rise; of the right number of phases."""
    known = [readings for readings in (one, other) if readings is not None and len(readings) == phases]
    if not known:
        return None
    return [(max(pair[0] for pair in pairs), max(pair[1] for pair in pairs)) for pairs in zip(*known, strict=True)]


def registers_of(
    phases: int, window_s: float, creep_W: float, state: Any, spooled: Sequence[float] | None = None
) -> Registers:
    """Registers that continue from `state` and from the numbers in the spool, whichever are greater.

    From zero, with a line in the log, where these are no state of theirs.
    """
    try:
        registers = Registers(phases, window_s, creep_W, state)
    except ValueError as error:
        _log.error("%s: reactive energy and demand start from zero", error)
        registers = Registers(phases, window_s, creep_W)
    if spooled is not None:
        try:
            registers.advance(spooled)
        except ValueError as error:
            _log.error("spool: %s; reactive energy and demand continue from the register file", error)
    return registers
