"""python -m tools.studies.packages [WHEEL] [--constraints FILE] [--only USE]: size and use of every extra.

The uses run without a compiler, git or the source tree in reach. Without a WHEEL, the source distribution is built
first, and the wheel from it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from acqd.cli.main import for_people
from acqd.errors import OperationError

ROOT = Path(__file__).parents[3]
SMOKE = Path(__file__).with_name("smoke.py")
USES = {"daemon": "", "sidecar": "sidecar", "loop": "loop", "fmu": "fmu"}
"""The extra of each use of smoke.py."""


def build(folder: Path, source: Path = ROOT) -> Path:
    """The wheel that comes of the source distribution of the tree `source`, in `folder`. Raises OperationError."""
    _run([sys.executable, "-m", "build", "--outdir", str(folder), str(source)], folder)
    return next(folder.glob("*.whl"))


def measure(wheel: Path, use: str, extra: str, constraints: Path | None) -> str:
    """One line: megabytes of an environment with the extra, seconds of the installation, and what the use says."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run([sys.executable, "-m", "venv", str(folder / "venv")], folder)
        python = str(folder / "venv" / "bin" / "python")
        before, started = _megabytes(folder / "venv"), time.monotonic()
        what = f"{wheel}[{extra}]" if extra else str(wheel)
        options = ["-c", str(constraints.resolve())] if constraints else []
        _run([python, "-m", "pip", "install", "--quiet", "--no-compile", *options, what], folder)
        seconds, size = time.monotonic() - started, _megabytes(folder / "venv") - before
        started = time.monotonic()
        said = _run([python, str(SMOKE), use], folder, bare(folder)).strip().splitlines()[-1]
        working = time.monotonic() - started
    return f"{use:8} acqd[{extra}]: {size:.0f} MB, installed in {seconds:.0f} s, used in {working:.0f} s; {said}"


def bare(folder: Path) -> dict[str, str]:
    """An environment without compiler, git and source tree: nothing on PATH, a home of its own."""
    (folder / "bin").mkdir()
    return {"PATH": str(folder / "bin"), "HOME": str(folder), "LANG": "C.UTF-8"}


def _megabytes(folder: Path) -> float:
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return sum(path.stat().st_size for path in files) / 1e6


def _run(command: list[str], cwd: Path, environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        raise OperationError(f"{' '.join(command[:4])}: {(done.stderr or done.stdout).strip()[-700:]}")
    return done.stdout


def main() -> None:
    """Print one line per use."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=Path, nargs="?")
    parser.add_argument("--constraints", type=Path, default=ROOT / "constraints.txt")
    parser.add_argument("--only", choices=USES)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        wheel = chosen.wheel.resolve() if chosen.wheel else build(Path(name))
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB")
        for use, extra in USES.items():
            if chosen.only in (None, use):
                print(measure(wheel, use, extra, chosen.constraints), flush=True)


if __name__ == "__main__":
    for_people(main)
