"""The tree of commands. A command line imports the module of its command, and none of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module, metadata
from typing import Annotated

import typer


@dataclass(frozen=True, slots=True)
class _Command:
    """A command, or a group of commands, below `acqd`."""

    name: str
    panel: str
    """Heading in the help."""
    group: bool = False
    """The module holds a tree of subcommands named `app`, not a function of the command's name."""
    room: str = ""
    """Module of the package `acqd.cli`, where it is not called like the command."""

    def add_to(self, app: typer.Typer) -> None:
        """Import the module and add what it holds."""
        plain = self.name.replace("-", "_")
        module = import_module(f"acqd.cli.{self.room or plain}")
        if self.group:
            app.add_typer(module.app, name=self.name, rich_help_panel=self.panel)
        else:
            app.command(self.name, rich_help_panel=self.panel)(getattr(module, plain))


_MEASURE, _DATA, _MODELS, _SERVICE = "Measure", "Data", "Models", "Service"
_COMMANDS = (
    _Command("run", _MEASURE),
    _Command("watch", _MEASURE),
    _Command("web", _MEASURE),
    _Command("replay", _MEASURE),
    _Command("capture", _MEASURE),
    _Command("archive", _MEASURE, group=True),
    _Command("conformance", _MEASURE),
    _Command("en50160", _DATA),
    _Command("energy", _DATA, group=True, room="energy.app"),
    _Command("ethercat", _MEASURE, group=True),
    _Command("modbus", _MEASURE, group=True),
    _Command("sink", _DATA, group=True),
    _Command("lab", _DATA, group=True),
    _Command("dataset", _DATA, group=True),
    _Command("robot", _MODELS, group=True),
    _Command("train", _MODELS, room="models.train"),
    _Command("compare", _MODELS, room="models.compare"),
    _Command("predict", _MODELS, room="models.predict"),
    _Command("close-loop", _MODELS),
    _Command("fleet", _MODELS),
    _Command("export-fmu", _MODELS),
    _Command("export-onnx", _MODELS),
    _Command("sidecar", _MODELS),
    _Command("config", _SERVICE, group=True),
    _Command("service", _SERVICE, group=True),
    _Command("opcua", _SERVICE),
    _Command("status", _SERVICE),
    _Command("doctor", _SERVICE),
    _Command("jitter", _SERVICE),
    _Command("alarms", _SERVICE, group=True),
    _Command("bridge", _SERVICE, group=True),
    _Command("broker", _SERVICE),
)


def command_tree(arguments: Sequence[str] = ()) -> typer.Typer:
    """The commands that `arguments` of the command line can mean: one if they start with its name, otherwise all."""
    app = typer.Typer(
        help="Energy twin measurement chain: 20 kHz samples in, trustworthy power rows out.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
    )
    app.callback()(_acqd)
    for command in [each for each in _COMMANDS if each.name in arguments[:1]] or _COMMANDS:
        command.add_to(app)
    return app


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"acqd {metadata.version('acqd')}")
        raise typer.Exit


def _acqd(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version.", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Energy twin measurement chain: 20 kHz samples in, trustworthy power rows out."""
