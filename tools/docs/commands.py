"""All commands of acqd as data, from the command tree itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, get_args, get_origin

import typer.main

from acqd.cli.commands import command_tree


@dataclass(frozen=True, slots=True)
class Parameter:
    """An argument or option."""

    name: str
    """As it is typed: `BUNDLE`, or `--out PATH`."""
    help: str
    default: str
    """Empty without one."""
    required: bool
    argument: bool


@dataclass(frozen=True, slots=True)
class Command:
    """A command that does something; a group of commands only if it does."""

    words: tuple[str, ...]
    """Such as ("acqd", "dataset", "build")."""
    panel: str
    """Heading in `acqd --help`."""
    help: str
    examples: list[str]
    parameters: list[Parameter]

    @property
    def name(self) -> str:
        """As it is typed."""
        return " ".join(self.words)

    @property
    def usage(self) -> str:
        """One line."""
        return " ".join([self.name, "[OPTIONS]", *(p.name for p in self.parameters if p.argument)])


def all_commands() -> list[Command]:
    """Every command, panel by panel in the order of `acqd --help`."""
    found = list(_below(typer.main.get_command(command_tree()), ("acqd",), ""))
    panels = list(dict.fromkeys(command.panel for command in found))
    return sorted(found, key=lambda command: panels.index(command.panel))


def _below(command: Any, words: tuple[str, ...], panel: str) -> Iterator[Command]:
    panel = getattr(command, "rich_help_panel", None) or panel
    children = getattr(command, "commands", None)
    if children:
        for name, child in children.items():
            if not child.hidden:
                yield from _below(child, (*words, name), panel)
        if not command.invoke_without_command or len(words) == 1:
            return
    text, examples = _parts(command.help or "")
    yield Command(words, str(panel), text, examples, [_parameter(each) for each in command.params if _shown(each)])


def _shown(parameter: Any) -> bool:
    return parameter.name != "help" and not getattr(parameter, "hidden", False)


def _parts(text: str) -> tuple[str, list[str]]:
    """The description, and the commands of its examples."""
    paragraphs = [" ".join(block.split()) for block in text.replace("\f", "").split("\n\n")]
    said, examples = [], []
    for paragraph in paragraphs:
        start = paragraph.partition(" ")[0]
        if start in ("Example:", "Examples:"):
            examples.append(paragraph.removeprefix(start).strip())
        elif examples and start in ("acqd", "sudo"):
            examples.append(paragraph)
        else:
            said.append(paragraph)
    return "\n\n".join(said), examples


def _parameter(parameter: Any) -> Parameter:
    argument = parameter.param_type_name == "argument"
    kind = parameter.metavar or _kind(parameter.type_descriptor.annotation)
    default = parameter.default
    plain = default is None or default is False or callable(default) or default in ((), [])
    shown = "" if plain else str(getattr(default, "value", default))
    names = ", ".join([*parameter.opts, *parameter.secondary_opts])
    name = (parameter.metavar or parameter.name.upper()) if argument else names
    if not argument and not parameter.is_flag and kind:
        name = f"{name} {kind}"
    return Parameter(name, getattr(parameter, "help", "") or "", shown, bool(parameter.required), argument)


def _kind(annotation: Any) -> str:
    """What a value is: its choices, or PATH, INT, FLOAT, TEXT."""
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return "|".join(str(choice.value) for choice in annotation)
    if get_origin(annotation) is Literal:
        return "|".join(map(str, get_args(annotation)))
    return {"str": "TEXT", "list": "TEXT"}.get(name := getattr(annotation, "__name__", ""), name.upper())
