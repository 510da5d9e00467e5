"""The program: the only place where errors become exit codes."""

from __future__ import annotations

import errno
import logging
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TextIO

from typer import Typer

from acqd.cli.commands import command_tree
from acqd.cli.standard_streams import READER_GONE, close_output, open_streams, say
from acqd.cli.usage import answered
from acqd.errors import OperationError, UserError, without_number
from acqd.garbage import uncollected

_PROGRAM = Path(__file__).resolve().parents[1]
_JOURNAL_LEVEL = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3, logging.CRITICAL: 2}


class _Stderr(logging.StreamHandler[TextIO]):
    """Writes to the stderr of the moment: a live table redirects it, so that lines go above the table."""

    @property
    def stream(self) -> TextIO:
        """As it is now."""
        return sys.stderr

    @stream.setter
    def stream(self, _: TextIO) -> None:
        """Ignore what the constructor sets."""


class _Lines(logging.Formatter):
    """One line per record; with systemd's priority prefix when the journal reads them."""

    def format(self, record: logging.LogRecord) -> str:
        text = without_number(super().format(record))
        if "JOURNAL_STREAM" in os.environ:
            return f"<{_JOURNAL_LEVEL.get(record.levelno, 6)}>{text}"
        return f"acqd: {record.levelname.lower()}: {text}" if record.levelno > logging.INFO else f"acqd: {text}"


def main() -> None:
    """Run the command line."""
    for_people(lambda: _imported(sys.argv[1:])(prog_name="acqd", standalone_mode=False))


def _imported(arguments: Sequence[str]) -> Typer:
    """The tree of commands, imported without the garbage collector.

    Modules stay: to look for garbage in them takes a tenth of the time that a command needs to start.
    """
    with uncollected():
        return command_tree(arguments)


def for_people(work: Callable[[], object]) -> None:
    """Run `work`, which may return an exit code; errors become one line.

    Exit codes: 0 ok, 1 failure, 2 bad input or usage, 130 interrupted, 141 the reader of the output has gone.
    """
    open_streams()
    handler = _Stderr()
    handler.setFormatter(_Lines())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    logging.getLogger("alembic").setLevel(logging.WARNING)
    logging.getLogger("mqtt").setLevel(logging.ERROR)
    try:
        code = work()
        close_output()  # here, where an error is answered
    except UserError as error:
        say(f"acqd: {error}")
        sys.exit(2)
    except OperationError as error:
        say(f"acqd: {error}")
        sys.exit(1)
    except OSError as error:
        if isinstance(error, BrokenPipeError):  # of a file that is a pipe
            sys.exit(READER_GONE)
        say(f"acqd: {_named(error)}")
        sys.exit(2 if error.errno in _REMEDIES else 1)
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        if not answered(error):
            if (line := _unanswered(error)) is None:
                raise
            say(f"acqd: {line}")
        sys.exit(2)
    if isinstance(code, int):
        sys.exit(code)


def _named(error: OSError) -> str:
    """The file, what the system says, and what helps; where no file is known, acqd's innermost step."""
    what = _WORDS.get(error.errno or 0) or error.strerror or " ".join(str(error).split()) or type(error).__name__
    remedy = _REMEDIES.get(error.errno or 0, "")
    if error.filename is not None:
        return f"{error.filename}: {what}{remedy}"
    import traceback  # only here: it is slow to import

    frames = list(traceback.walk_tb(error.__traceback__))
    ours = [k for k, (frame, _) in enumerate(frames) if _PROGRAM in Path(frame.f_code.co_filename).parents]
    if not ours:
        return f"{what}{remedy}"
    frame, line = frames[ours[-1]]
    file = Path(frame.f_code.co_filename).relative_to(_PROGRAM.parent)
    return f"{what}, in {frame.f_code.co_name} ({file}, line {line}){remedy}"


_WORDS = {errno.ENOENT: "no such file or folder", errno.EISDIR: "is a folder"}
"""As the messages of every command."""
_ROOM, _RIGHTS = "; make room, or choose another disk", "; choose another place, or allow it to this user"
_REMEDIES = {
    errno.ENOSPC: _ROOM, errno.EDQUOT: _ROOM, errno.EFBIG: _ROOM,
    errno.EACCES: _RIGHTS, errno.EPERM: _RIGHTS, errno.EROFS: _RIGHTS,
    errno.ENOENT: "; check the path", errno.ENOTDIR: "; a file is where the path has a folder",
    errno.EISDIR: "; expected a file", errno.EEXIST: "; remove it, or choose another name",
    errno.ENAMETOOLONG: "; choose a shorter name", errno.EMFILE: "; raise the limit of open files (ulimit -n)",
}  # fmt: skip
"""Of errors that another input, place or setting would have prevented."""


def _unanswered(error: Exception) -> str | None:
    """Of a database, in one line; None for a bug."""
    if "sqlalchemy" not in sys.modules:  # which is slow to import
        return None
    from acqd.storage.database import unanswered

    return unanswered(error)
