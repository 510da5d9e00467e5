"""A command line that cannot be understood, in one line."""

from __future__ import annotations

import re
from difflib import SequenceMatcher
from typing import Any

from typer.core import TyperGroup

from acqd.cli.standard_streams import say
from acqd.errors import UserError, in_our_words

_WORDS = (
    (r"^Invalid value for '([^']*)'(?: / '[^']*')*: ", r"\1: "),
    (r": dir(?:ectory)? '(.*)' does not exist$", r": \1: no such folder"),
    (r": path '(.*)' is not readable$", r": \1: may not be read by this user: check its permissions"),
    (r": Value error, ", ": "),
    (r" is not one of ", ": expected "),
    (r" does not match the formats? .*$", ": expected a time like 2026-11-16T06:00:00 (UTC)"),
    (r"^No such option: (-[\d.]+)$", r"\1: expected a number that is not negative"),
    (r"^No such", "no such"),
    (r"^Missing", "missing"),
    (r"^Got unexpected", "unexpected"),
    (r"^Option '([^']*)' requires (an argument|\d+ arguments)", r"\1: expected \2 after the option"),
    (r" \(Possible options: (.*)\)", r" (did you mean \1?)"),
    (r"\. Did you mean (.*)\?", r" (did you mean \1?)"),
)
"""Of click, in the words of this program."""

_LEAST_LIKENESS = 0.6
"""As of `difflib.get_close_matches`, which click asks with the dashes."""
_SAME: tuple[tuple[str, ...], ...] = (
    ("--duration", "--seconds", "--minutes", "--time", "--timeout"),
    ("--out", "--output", "--csv", "--html", "--file", "--out-file"),
    ("--from", "--since", "--start", "--begin", "--after"), ("--to", "--until", "--end", "--stop", "--before"),
    ("--database", "--db", "--sqlite", "--sql", "--url"), ("--host", "--broker", "--server", "--listen", "--address"),
    ("--yes", "--force"), ("--dry-run", "--check"), ("--limit", "--max", "--count"), ("--jobs", "--workers"),
    ("--config", "--configuration", "--settings"),
)  # fmt: skip
"""Options that programs call by several names: the one that a command has is meant."""


def answered(error: Exception) -> bool:
    """Whether `error` was about the command line; if so, stderr has one line, or the help of a group of commands.

    Errors of usage are recognised by what they have: versions of Typer keep click's classes in different modules.
    """
    message = getattr(error, "format_message", None)
    if message is None:
        return False
    if hasattr(error, "option_name") and hasattr(error, "possibilities"):
        error.possibilities = _meant(error) or [name for name in error.possibilities or () if _alike(error, name)]
    text = str(message())  # which may print the help by itself
    if type(error).__name__ == "NoArgsIsHelpError":
        if text:
            say(text)
        return True
    said = " ".join(text.split()).rstrip(".")
    for pattern, replacement in _WORDS:
        said = re.sub(pattern, replacement, said)
    place, _, complaint = said.rpartition(": ")
    said = f"{place}{': ' if place else ''}{in_our_words(complaint)}"
    context = getattr(error, "ctx", None)
    whole = context.command_path if context is not None else "acqd"
    command = whole.removeprefix("acqd").strip()
    say(f"acqd: {command}{': ' if command else ''}{said}; see {whole} --help")
    return True


def _meant(error: Any) -> list[str]:
    """Options of the command that mean what an unknown one says."""
    command = getattr(getattr(error, "ctx", None), "command", None)
    known = [
        name for each in getattr(command, "params", []) if not getattr(each, "hidden", False) for name in each.opts
    ]
    wanted = str(getattr(error, "option_name", ""))
    return [name for same in _SAME if wanted in same for name in same if name in known]


def _alike(error: Any, name: str) -> bool:
    """Whether a name is the unknown one misspelt: `--robot` is no misspelt `--out`, which click proposes."""
    wanted = str(getattr(error, "option_name", "")).lstrip("-")
    return SequenceMatcher(None, wanted, name.lstrip("-")).ratio() >= _LEAST_LIKENESS


def _require_once(command: Any, context: Any, words: list[str]) -> None:
    """Raises UserError for an option that stands twice and takes one value: click would take the last in silence.

    A switch that can only be on (--json) says nothing else when it stands twice.
    """
    try:
        order = command.make_parser(context).parse_args(args=list(words))[2]
    except Exception:
        return  # said when the command itself reads its words
    options = [each for each in order if each.param_type_name == "option"]
    one_value = [
        each for each in options if not each.multiple and not each.count and (not each.is_flag or each.secondary_opts)
    ]
    if twice := [each for each in one_value if one_value.count(each) > 1]:
        names = " or ".join([*twice[0].opts[:1], *twice[0].secondary_opts[:1]])
        path = context.command_path.removeprefix("acqd ")
        raise UserError(f"{path}: {names} is given more than once; leave one of them")


class NamingGroup(TyperGroup):
    """A group of commands that tells an error of usage which command it is about.

    An option without its value is an error of click's parser, which knows no command.
    """

    _read: Any = None
    """Name and command whose arguments are being read."""

    # Versions of Typer keep click's classes in different modules, hence Any.
    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """As click's, and remembers the command; of an unknown one, it says which groups have it."""
        try:
            name, command, rest = super().resolve_command(ctx, args)
        except Exception as error:
            unknown: Any = error
            message = getattr(error, "message", "Did you mean")
            groups = [name for name, each in self.commands.items() if args[0] in getattr(each, "commands", {})]
            if groups and "Did you mean" not in message:
                meant = ", ".join(f"'{ctx.command_path} {name} {args[0]}'" for name in groups)
                unknown.message = f"{message.rstrip('.')}. Did you mean {meant}?"
            raise
        self._read = (name, command)
        if command is not None:
            _require_once(command, command.context_class(command, info_name=name, parent=ctx), rest)
        return name, command, rest

    def invoke(self, ctx: Any) -> Any:
        """As click's; an error of usage without a context gets that of the command that was read."""
        try:
            return super().invoke(ctx)
        except Exception as error:
            lost: Any = error
            if hasattr(error, "format_message") and getattr(error, "ctx", None) is None and self._read is not None:
                name, command = self._read
                lost.ctx = command.context_class(command, info_name=name, parent=ctx)
            raise
