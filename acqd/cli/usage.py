"""A command line that cannot be understood, in one line."""

from __future__ import annotations

import re
import sys
from typing import Any

from acqd.errors import in_our_words

_WORDS = (
    (r"^Invalid value for '([^']*)': ", r"\1: "),
    (r" is not one of ", ": expected "),
    (r"^No such option: (-[\d.]+)$", r"\1: expected a number that is not negative"),
    (r"^No such", "no such"),
    (r"^Missing", "missing"),
    (r"^Got unexpected", "unexpected"),
    (r"^Option '([^']*)' requires (an argument|\d+ arguments)", r"\1: expected \2 after the option"),
    (r" \(Possible options: (.*)\)", r" (did you mean \1?)"),
    (r"\. Did you mean (.*)\?", r" (did you mean \1?)"),
)
"""Of click, in the words of this program."""


def answered(error: Exception) -> bool:
    """Whether `error` was about the command line; if so, stderr has one line, or the help of a group of commands.

    Errors of usage are recognised by what they have: versions of Typer keep click's classes in different modules.
    """
    message = getattr(error, "format_message", None)
    if message is None:
        return False
    text = str(message())  # which may print the help by itself
    if type(error).__name__ == "NoArgsIsHelpError":
        print(text, end="\n" if text else "", file=sys.stderr)
        return True
    said = " ".join(text.split()).rstrip(".")
    for pattern, replacement in _WORDS:
        said = re.sub(pattern, replacement, said)
    place, _, complaint = said.rpartition(": ")
    said = f"{place}{': ' if place else ''}{in_our_words(complaint)}"
    context = getattr(error, "ctx", None) or _context(error)
    whole = context.command_path if context is not None else "acqd"
    command = whole.removeprefix("acqd").strip()
    print(f"acqd: {command}{': ' if command else ''}{said}; see {whole} --help", file=sys.stderr)
    return True


def _context(error: Exception) -> Any:
    """Of the command whose arguments were read: an option without its value is an error that does not name it."""
    import traceback  # only here: it is slow to import

    contexts = [frame.f_locals.get("ctx") for frame, _ in traceback.walk_tb(error.__traceback__)]
    return next((context for context in reversed(contexts) if hasattr(context, "command_path")), None)
