"""Standard output that is closed, full, or read no longer: every command ends in the same way.

POSIX tools are the model. A reader that leaves (`acqd ... | head -1`) ends the program without a word and with 141, the
status that a shell has for a program that SIGPIPE has ended; SIGPIPE itself would end the program for sockets as well.
Output that cannot be written, because the disk is full or standard output is closed (`>&-`), is an error.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys

from acqd.errors import UserError

READER_GONE = 128 + signal.SIGPIPE


class _StandardOutput(io.FileIO):
    """Descriptor 1. After the first failure everything goes to /dev/null: the interpreter flushes again at its end."""

    failure: BaseException | None = None
    """Kept: who prints may drop it, as typer does where it prints the help."""

    def write(self, data: bytes, /) -> int | None:  # type: ignore[override]  # any buffer
        try:
            return super().write(data)
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            self.failure = _failure(error)
            raise self.failure from None


def _failure(error: OSError) -> BaseException:
    if error.errno == errno.EPIPE:
        return SystemExit(READER_GONE)
    if error.errno == errno.EBADF:
        return UserError("standard output is closed; send the output somewhere, as with > FILE")
    error.filename = "standard output"
    return error


def close_output() -> None:
    """Write what is still buffered. Raises what has kept output from being written, now or before."""
    sys.stdout.flush()
    raw = getattr(sys.stdout.buffer, "raw", sys.stdout.buffer) if hasattr(sys.stdout, "buffer") else None
    if isinstance(raw, _StandardOutput) and raw.failure is not None:
        raise raw.failure


def open_streams() -> None:
    """Let every failure of standard output end this program with one line, or none for a reader that has gone.

    Descriptors 0 to 2 that are closed are opened on /dev/null, for reading only, so that no other file takes their
    numbers and output to them fails (gnulib's `stdopen`).
    """
    for descriptor in (0, 1, 2):  # the lowest free number is what a file gets
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDONLY), True)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # as long as the program
    if sys.stdout is not sys.__stdout__:
        return  # somebody in this process reads what is printed
    like = sys.stdout
    unbuffered = like is not None and like.write_through
    raw = _StandardOutput(1, "w", closefd=False)
    sys.stdout = io.TextIOWrapper(
        raw if unbuffered else io.BufferedWriter(raw),
        encoding="utf-8" if like is None else like.encoding, errors=None if like is None else like.errors,
        line_buffering=raw.isatty(), write_through=unbuffered,
    )  # fmt: skip


def say(line: str) -> None:
    """A line on standard error; where nobody can read it the exit code remains."""
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
