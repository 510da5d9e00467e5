"""Man pages of all commands, in roff."""

from __future__ import annotations

from pathlib import Path

from acqd import __version__
from tools.docs.commands import Command, all_commands


def write_man_pages(folder: Path) -> list[Path]:
    """acqd.1 and a page per command into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    commands = all_commands()
    pages = {"acqd": overview(commands)} | {"-".join(command.words): page(command) for command in commands}
    written = []
    for name, text in pages.items():
        path = folder / f"{name}.1"
        path.write_text(text, encoding="utf-8")
        written.append(path)
    return written


def overview(commands: list[Command]) -> str:
    """The page acqd(1)."""
    lines = [_head("acqd"), ".SH NAME", "acqd \\- meters a robot's mains power, predicts it, and names causes"]
    lines += [".SH SYNOPSIS", ".B acqd", ".I COMMAND [OPTIONS]", ".SH COMMANDS"]
    for command in commands:
        lines += [".TP", f".BR {_roff('-'.join(command.words))} (1)", _roff(_first_sentence(command.help))]
    lines += [".SH EXIT STATUS", "0 success; 2 bad input or configuration, named in one line; 1 any other failure."]
    return "\n".join([*lines, ""])


def page(command: Command) -> str:
    """The page of one command."""
    name = "-".join(command.words)
    lines = [_head(name), ".SH NAME", f"{_roff(name)} \\- {_roff(_first_sentence(command.help))}"]
    lines += [".SH SYNOPSIS", f".B {_roff(command.usage)}", ".SH DESCRIPTION", _roff(command.help)]
    for heading, argument in (("ARGUMENTS", True), ("OPTIONS", False)):
        chosen = [parameter for parameter in command.parameters if parameter.argument == argument]
        if chosen:
            lines.append(f".SH {heading}")
        for parameter in chosen:
            default = f" Default: {parameter.default}." if parameter.default else ""
            lines += [".TP", f".B {_roff(parameter.name)}", _roff(parameter.help + default)]
    if command.examples:
        lines.append(".SH EXAMPLES")
    for example in command.examples:
        lines += [".nf", _roff(example), ".fi"]
    lines += [".SH SEE ALSO", ".BR acqd (1)"]
    return "\n".join([*lines, ""])


def _head(name: str) -> str:
    return f'.TH "{_roff(name.upper())}" "1" "" "acqd {__version__}" "acqd"'


def _first_sentence(text: str) -> str:
    return text.split("\n\n")[0].split(". ")[0].rstrip(".")


def _roff(text: str) -> str:
    """Escaped: backslashes, hyphens, and lines that begin like a request."""
    escaped = text.replace("\\", "\\e").replace("-", "\\-").replace("\n\n", "\n.PP\n")
    lines = escaped.split("\n")
    return "\n".join(f"\\&{line}" if line.startswith((".", "'")) and line != ".PP" else line for line in lines)
