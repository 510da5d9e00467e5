"""`acqd config`: the commented configuration file."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.cli.options import Json
from acqd.errors import UserError

app = typer.Typer(help="The configuration file.", no_args_is_help=True)


@app.callback()
def _config() -> None:
    """The configuration file."""


@app.command()
def init(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Where to write it; - is stdout.")] = Path("acqd.toml"),
    json: Json = False,
) -> None:
    """Write acqd.toml with every key, its default and its meaning. An existing file is left as it is.

    Example: acqd config init acqd.toml
    """
    text = files("acqd.daemon").joinpath("acqd.toml").read_text(encoding="utf-8")
    if str(path) == "-":
        print(text, end="")
        return
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UserError(f"{path} exists: remove it, or name another file") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror})") from None
    print(orjson.dumps({"file": str(path)}).decode() if json else f"{path}: try it with acqd run --config {path}")
