"""What a parser may do with an input: take it, or refuse it in one line."""

from __future__ import annotations

import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Literal

from acqd.errors import UserError
from tools.studies.fuzz.mutate import Files
from tools.studies.fuzz.targets import Target

_LONGEST = 4000
"""Characters of one line that a terminal and a log can still show."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One input's end."""

    kind: Literal["accepted", "refused", "failure"]
    reason: str = ""
    """Of a failure: exception and place, the same for the same mistake."""


class HangError(BaseException):
    """A parser took longer than its time. No `except Exception` may catch it."""


def outcome(target: Target, files: Files, limit_s: float) -> Outcome:
    """Runs one input. Only in a main thread: the time limit is a signal."""
    with _ignored() as ignored:
        end = _end(target, files, limit_s)
    if ignored and end.kind != "failure":
        return Outcome("failure", f"a traceback is printed and ignored: {ignored[0]}")
    return end


def _end(target: Target, files: Files, limit_s: float) -> Outcome:
    try:
        with _time_limit(limit_s):
            target.run(files)
    except UserError as error:
        return _of_message(str(error))
    except target.refusals as error:
        return _of_message(str(error))
    except HangError:
        return Outcome("failure", f"longer than {limit_s} s")
    except Exception as error:
        return Outcome("failure", _place(error))
    return Outcome("accepted")


@contextmanager
def _ignored() -> Iterator[list[str]]:
    """What Python cannot raise, in a callback or a destructor, and prints with a traceback."""
    found: list[str] = []
    before = sys.unraisablehook
    sys.unraisablehook = lambda what: found.append(f"{what.exc_type.__name__} in {what.object!r:.60}")
    try:
        yield found
    finally:
        sys.unraisablehook = before


def _of_message(message: str) -> Outcome:
    if len(message.splitlines()) != 1:
        return Outcome("failure", f"a message of {len(message.splitlines())} lines: {message[:80]!r}")
    if len(message) > _LONGEST:
        return Outcome("failure", f"a message of more than {_LONGEST} characters: {message[:80]!r}")
    return Outcome("refused")


def _place(error: Exception) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "/acqd/" in frame.filename] or list(frames)
    file, line = ours[-1].filename.rpartition("/acqd/")[2], ours[-1].lineno
    return f"{type(error).__name__} in {file}:{line}: {str(error)[:100]!r}"


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    def ring(_number: int, _frame: FrameType | None) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
