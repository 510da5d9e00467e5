"""Generated pages of the site: commands, configuration, report.json, API."""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path

import acqd
from tools.docs.commands import Command, all_commands
from tools.docs.report_keys import KEYS

ROOT = Path(__file__).parents[2]


def pages() -> dict[str, str]:
    """Markdown by path below the folder of the documentation."""
    return {
        "reference/commands.md": commands(),
        "reference/configuration.md": configuration(),
        "reference/report.md": report(),
        "reference/api.md": api(),
    }


def commands() -> str:
    """Every command with its parameters."""
    lines = ["# Commands", "", "Every command has `--json` or prints JSON, and `--help` with an example."]
    panel = ""
    for command in all_commands():
        if command.panel != panel:
            panel = command.panel
            lines += ["", f"## {panel}"]
        lines += _command(command)
    return "\n".join([*lines, ""])


def _command(command: Command) -> list[str]:
    lines = ["", f"### {command.name}", "", "```sh", command.usage, "```", "", command.help, ""]
    if command.parameters:
        lines += ["| parameter | meaning | default |", "|---|---|---|"]
    for parameter in command.parameters:
        default = "required" if parameter.required else f"`{parameter.default}`" if parameter.default else ""
        lines.append(f"| `{_cell(parameter.name)}` | {_cell(parameter.help)} | {_cell(default)} |")
    if command.examples:
        lines += ["", "```sh", *command.examples, "```"]
    return lines


def configuration() -> str:
    """The commented files of configuration."""
    lines = ["# Configuration"]
    for name, about in (("acqd.toml", "`acqd config init` writes it."), ("lab.toml", "Of `acqd lab`.")):
        text = (ROOT / "config" / name).read_text(encoding="utf-8").rstrip()
        lines += ["", f"## {name}", "", about, "", "```toml", text, "```"]
    return "\n".join([*lines, ""])


def report() -> str:
    """Keys of report.json."""
    lines = ["# report.json", "", "What `acqd close-loop` writes. Errors are on held-out recordings.", ""]
    lines += ["| key | type | meaning |", "|---|---|---|"]
    lines += [f"| `{key}` | {kind} | {_cell(meaning)} |" for key, (kind, meaning) in KEYS.items()]
    return "\n".join([*lines, ""])


def api() -> str:
    """The public interface, from its docstrings."""
    lines = [
        "# Python",
        "",
        f"`import acqd` (version {acqd.__version__}). Names follow semantic versioning; everything",
    ]
    lines += [
        "else in acqd may change. Errors that a user can act on are `UserError` (with `InputError` for files) and"
    ]
    lines += ["`OperationError`, each with one line."]
    names = [name for name in acqd.__all__ if name != "__version__"]
    for name in sorted(names, key=str.lower):
        lines += _object(name, getattr(acqd, name))
    try:
        from acqd.api.estimator import PowerRegressor
    except acqd.UserError:
        return "\n".join([*lines, ""])
    return "\n".join([*lines, *_object("PowerRegressor", PowerRegressor, "acqd.api.estimator"), ""])


def _object(name: str, value: object, module: str = "acqd") -> list[str]:
    lines = ["", f"## {name}", "", "```python", f"{module}.{name}{_signature(value)}", "```", "", *_documented(value)]
    if not inspect.isclass(value) or issubclass(value, Exception):
        return lines
    for attribute, member in vars(value).items():
        raw = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if attribute.startswith("_") or not inspect.getdoc(raw) or not (callable(raw) or isinstance(raw, property)):
            continue
        shown = "" if isinstance(raw, property) else _signature(raw)
        lines += ["", f"**`{attribute}{shown}`**", "", *_documented(raw)]
    return lines


def _signature(value: object) -> str:
    if not callable(value) or (inspect.isclass(value) and issubclass(value, Exception)):
        return ""
    if dataclasses.is_dataclass(value):
        return ": " + ", ".join(field.name for field in dataclasses.fields(value))
    return str(inspect.signature(value)).replace("'", "")


def _documented(value: object) -> list[str]:
    """A docstring, its examples as code."""
    text = inspect.getdoc(value) or ""
    prose, _, example = text.partition("\n>>> ")
    return [prose.strip()] + (["", "```python", f">>> {example}", "```"] if example else [])


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
