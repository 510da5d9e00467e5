"""The file of marks: a line whenever what a device works on changes, each with everything that is known of it."""

from __future__ import annotations

import csv
import errno
import io
import os
from pathlib import Path

from acqd.energy.marks import KINDS, ticks_of
from acqd.errors import InputError
from acqd.timestamps import rfc3339

_HEADER = ("time", "device", *KINDS)
_STEP_NS = 1_000
"""Between lines of a device: times in the file rise."""
_LATE_NS = 1_000_000_000
"""By which a message may be older than the one before of its kind: the production system's clock is corrected."""
_AWAY_S = 5.0
"""Without a beat for so long, nobody knows what was worked on."""
Values = dict[str, str]


class MarksFile:
    """Appends lines. The time of its last change is that of the last beat."""

    def __init__(self, path: Path, now_ns: int) -> None:
        """Go on with a file, or make one. Raises InputError for another file."""
        self._path = path
        self._known: dict[str, Values] = {}
        self._last_ns: dict[str, int] = {}
        self._said_ns: dict[tuple[str, str], int] = {}
        """Newest time of a message, by device and kind, since somebody has listened without a break."""
        beaten_ns = self._read()
        self.lines = 0
        """Written by this process."""
        self._beaten_ns = beaten_ns or now_ns

    def put(self, device: str, kind: str, value: str, at_ns: int) -> bool:
        """Write that a device works on `value` since `at_ns`; False if an earlier message of this kind was newer.

        Times in the file rise: what began before the last line of the device begins right after that line.
        """
        known = self._known.get(device, dict.fromkeys(KINDS, ""))
        said_ns = self._said_ns.get((device, kind), 0)
        if known[kind] != value:
            if at_ns < said_ns - _LATE_NS:
                return False
            self._write(device, known | {kind: value}, max(at_ns, self._last_ns.get(device, 0) + _STEP_NS))
        self._said_ns[device, kind] = max(at_ns, said_ns)
        return True

    def beat(self, now_ns: int) -> None:
        """Somebody listens: what is known still holds."""
        if now_ns - self._beaten_ns > _AWAY_S * 1e9:
            self.forget(self._beaten_ns)
        self._beaten_ns = now_ns
        os.utime(self._path, ns=(now_ns, now_ns))

    def forget(self, at_ns: int) -> None:
        """From then on nobody listened: what devices worked on is unknown until they say so again."""
        self._said_ns.clear()
        for device, known in list(self._known.items()):
            if any(known.values()):
                self._write(device, dict.fromkeys(KINDS, ""), max(at_ns, self._last_ns[device] + _STEP_NS))

    def _write(self, device: str, values: Values, at_ns: int) -> None:
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerow([rfc3339(at_ns), device, *(values[kind] for kind in KINDS)])
        self._append(text.getvalue())
        self._known[device], self._last_ns[device] = values, at_ns
        self.lines += 1

    def _append(self, text: str) -> None:
        """All of it, or nothing. Raises OSError."""
        content = text.encode()
        descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o640)
        try:
            if (written := os.write(descriptor, content)) < len(content):  # the disk is full
                os.ftruncate(descriptor, os.fstat(descriptor).st_size - written)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self._path))
        finally:
            os.close(descriptor)

    def _read(self) -> int | None:
        """Learn the last line of every device, and when somebody last listened (Unix ns); None for a new file."""
        try:
            content, beaten_ns = self._path.read_bytes(), self._path.stat().st_mtime_ns
        except FileNotFoundError:
            content, beaten_ns = b"", None
        except OSError as error:
            raise InputError(self._path, f"cannot be read ({error.strerror}); see [marks] file") from None
        if not content:
            self._append(",".join(_HEADER) + "\n")
            return None
        if not content.endswith(b"\n"):  # the line that a power cut has left
            os.truncate(self._path, content.rfind(b"\n") + 1)
            content = content[: content.rfind(b"\n") + 1]
        rows = list(csv.reader(io.StringIO(content.decode(errors="replace"), newline="\n")))
        if not rows or tuple(rows[0]) != _HEADER:
            raise InputError(self._path, f"is no file of acqd bridge marks: expected the header {','.join(_HEADER)}")
        for number, row in enumerate(rows[1:], start=2):
            if len(row) != len(_HEADER):
                raise InputError(self._path, f"line {number}: {len(row)} values, expected {len(_HEADER)}; remove it")
            self._known[row[1]] = dict(zip(KINDS, row[2:], strict=True))
            self._last_ns[row[1]] = 100 * ticks_of(self._path, number, row[0])
        return beaten_ns
