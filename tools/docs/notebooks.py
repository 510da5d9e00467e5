"""Notebooks run and stored with their outputs, without what only this computer has.

    python -m tools.docs.notebooks [NOTEBOOK ...]        # all of docs/notebooks; needs acqd[notebooks]

Each notebook runs in an empty folder. Its outputs keep tables, texts and pictures; the folder, the home directory and
times of execution are left out. `metadata.acqd.sources` is a hash of the code that made them: outputs of other code
are noticed by a test.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

from acqd.errors import OperationError, UserError

NOTEBOOKS = Path(__file__).parents[2] / "docs" / "notebooks"
MACHINE_PATH = re.compile(r"(?<![\w./])/(?:home|root|tmp|var|work|usr|opt|Users|private)/[\w.+/-]+")
"""An absolute path in a text."""
_COLOURS = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
_TIMEOUT_S = 7200
"""Of a cell: ten minutes on a quiet computer."""
_KEPT = ("text/plain", "text/html", "image/png")


def sources_of(notebook: dict[str, Any]) -> str:
    """Hash of the code cells."""
    code = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return hashlib.sha256("\0".join(code).encode()).hexdigest()[:16]


def portable(notebook: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The notebook without paths and times of the computer; `folder`: where the notebook has run."""
    for cell in notebook["cells"]:
        cell["metadata"] = {}
        if cell["cell_type"] == "code":
            kept = [output for output in cell["outputs"] if output.get("name") != "stderr"]
            cell["outputs"] = [_portable(output, folder) for output in kept]
    notebook["metadata"] = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
        "acqd": {"sources": sources_of(notebook)},
    }
    return notebook


def _portable(output: dict[str, Any], folder: Path) -> dict[str, Any]:
    if "text" in output:
        return output | {"text": _plain(output["text"], folder)}
    data = {kind: output["data"][kind] for kind in _KEPT if kind in output["data"]}
    plain = {kind: value if kind.startswith("image/") else _plain(value, folder) for kind, value in data.items()}
    return output | {"data": plain, "metadata": {}}


def _plain(text: str | list[str], folder: Path) -> list[str]:
    """Lines as Jupyter stores them."""
    without = (
        _COLOURS.sub("", "".join(text))
        .replace(f"{folder}/", "")
        .replace(str(folder), ".")
        .replace(str(Path.home()), "~")
    )
    left = MACHINE_PATH.search(without)
    if left:
        raise OperationError(f"an output has the path {left.group()}: print a name instead")
    return without.splitlines(keepends=True)


def run(path: Path) -> dict[str, Any]:
    """Execute a notebook in an empty folder. Raises OperationError; UserError without its programs."""
    try:
        from nbclient import NotebookClient
        from nbclient.exceptions import CellExecutionError, CellTimeoutError
    except ImportError as error:
        raise UserError(f"needs {error.name}: make install EXTRA=notebooks") from None

    nbformat: Any = import_module("nbformat")
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as place:
        try:
            NotebookClient(notebook, timeout=_TIMEOUT_S, resources={"metadata": {"path": place}}).execute()
        except CellTimeoutError:
            raise OperationError(f"{path}: a cell took longer than {_TIMEOUT_S} s") from None
        except CellExecutionError as error:
            raise OperationError(f"{path}: {str(error).strip().splitlines()[-1]}") from None
        return portable(json.loads(nbformat.writes(notebook)), Path(place).resolve())


def main() -> None:
    """Run and store."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("notebooks", type=Path, nargs="*", default=sorted(NOTEBOOKS.glob("*.ipynb")))
    for path in parser.parse_args().notebooks:
        content = run(path)
        path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    from acqd.cli.main import for_people

    for_people(main)
