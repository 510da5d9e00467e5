"""The tree of commands. A command line imports the module of its command, and none of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module, metadata
from typing import Annotated, Any

import typer

from acqd.cli.usage import NamingGroup


@dataclass(frozen=True, slots=True)
class _Command:
    """A command, or a group of commands, below `acqd`."""

    name: str
    panel: str
    """Step of the work, in the help."""
    about: str
    """What it is for, in 23 letters at most."""
    group: bool = False
    """The module holds a tree of subcommands named `app`, not a function of the command's name."""
    room: str = ""
    """Module of the package `acqd.cli`, where it is not called like the command."""

    def add_to(self, app: typer.Typer) -> None:
        """Import the module and add what it holds."""
        plain = self.name.replace("-", "_")
        module = import_module(f"acqd.cli.{self.room or plain}")
        if self.group:
            app.add_typer(module.app, name=self.name, cls=NamingGroup, rich_help_panel=self.panel)
        else:
            name = (self.room or plain).rpartition(".")[2]
            app.command(self.name, rich_help_panel=self.panel)(getattr(module, name))


_SET_UP, _MEASURE, _COUNT = "set up", "measure", "count"
_RECORD, _MODEL, _EXPLAIN, _HAND_ON = "record", "model", "explain", "hand on"
_COMMANDS = (
    _Command("plan", _SET_UP, "what N robots need"),
    _Command("config", _SET_UP, "acqd.toml: check, diff", group=True),
    _Command("service", _SET_UP, "install, update, backup", group=True),
    _Command("doctor", _SET_UP, "is this computer fit?"),
    _Command("jitter", _SET_UP, "how late tasks wake"),
    _Command("ethercat", _SET_UP, "terminals on the wire", group=True),
    _Command("modbus", _SET_UP, "meters on a bus", group=True),
    _Command("broker", _SET_UP, "a broker to try out"),
    _Command("run", _MEASURE, "the daemon, or a demo"),
    _Command("watch", _MEASURE, "live values here"),
    _Command("web", _MEASURE, "live page in a browser"),
    _Command("status", _MEASURE, "is everything all right?"),
    _Command("replay", _MEASURE, "a recorded waveform"),
    _Command("capture", _MEASURE, "the newest samples"),
    _Command("archive", _MEASURE, "samples kept: export", group=True),
    _Command("conformance", _MEASURE, "limits of the standards"),
    _Command("sink", _COUNT, "rows from MQTT into SQL", group=True),
    _Command("energy", _COUNT, "kWh, cost and causes", group=True, room="energy.app"),
    _Command("save", _COUNT, "motion that uses less"),
    _Command("en50160", _COUNT, "a week of the voltage"),
    _Command("lab", _RECORD, "virtual robot and mains", group=True),
    _Command("dataset", _RECORD, "power and motion merged", group=True),
    _Command("robot", _MODEL, "descriptions of robots", group=True),
    _Command("train", _MODEL, "a model of the power", room="models.train"),
    _Command("compare", _MODEL, "models on one data set", room="models.compare"),
    _Command("predict", _MODEL, "power of a robot's log", room="models.predict"),
    _Command("try", _EXPLAIN, "from robot to verdict", room="trial"),
    _Command("close-loop", _EXPLAIN, "the cause of a residual"),
    _Command("next", _EXPLAIN, "the motion that decides", room="next_motion"),
    _Command("fleet", _EXPLAIN, "the loop, many robots"),
    _Command("sidecar", _EXPLAIN, "logs as they arrive"),
    _Command("guide", _EXPLAIN, "what to do next, and how"),
    _Command("plant", _HAND_ON, "page, month, inventory", group=True),
    _Command("reports", _HAND_ON, "all reports on a page"),
    _Command("alarms", _HAND_ON, "by webhook and mail", group=True),
    _Command("bridge", _HAND_ON, "Home Assistant, Influx", group=True),
    _Command("opcua", _HAND_ON, "rows for OPC UA clients"),
    _Command("export-fmu", _HAND_ON, "a model for FMI tools"),
    _Command("export-onnx", _HAND_ON, "a network as ONNX"),
)
_ABOUT = "Energy twin measurement chain: 20 kHz samples in, trustworthy power rows out."


class _OnAScreen(NamingGroup):
    """Help in the order of work, two commands a line: it fits a terminal of 80 columns and 24 lines."""

    def format_help(self, ctx: Any, formatter: Any) -> None:  # versions of Typer have click's classes in other modules
        """Write a block for each step of the work."""
        name = ctx.command_path
        lines = [f"Usage: {name} COMMAND ...      {name} COMMAND --help has an example", _ABOUT]
        lines += [f"{name} --version; {name} --install-completion: commands and options by the TAB key"]
        for panel in dict.fromkeys(command.panel for command in _COMMANDS):
            cells = [f"{one.name:12}{one.about:24}" for one in _COMMANDS if one.panel == panel]
            titles = [panel, *[""] * len(cells)]
            lines += [f"{titles[k]:8}{''.join(cells[k : k + 2])}".rstrip() for k in range(0, len(cells), 2)]
        formatter.write("\n".join(lines))


def command_tree(arguments: Sequence[str] = ()) -> typer.Typer:
    """The commands that `arguments` of the command line can mean: one if they start with its name, otherwise all."""
    app = typer.Typer(
        help=_ABOUT,
        cls=_OnAScreen,
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
    """The program `acqd`."""
