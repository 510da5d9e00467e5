"""The steps of a case: `dataset build`, `train`, `close-loop`, in this process or as commands of any source tree."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

NETWORK = "grey-box"
"""The model of every plant."""


class StepError(Exception):
    """A step cannot be done; the message says why, in acqd's words where acqd refused."""


class Steps(Protocol):
    """What is judged. All raise StepError."""

    def build(
        self, power: Path, logs: Path, robot: Path, out: Path, *, lag_s: float | None, cut_s: float | None,
        worked_min: float = 0.0,
    ) -> None:  # fmt: skip
        """A dataset of power rows and logs, with options of `acqd dataset build`."""

    def train(self, dataset: Path, bundle: Path) -> None:
        """A model of a dataset."""

    def close(self, dataset: Path, bundle: Path, out: Path) -> dict[str, Any]:
        """What the loop reports."""


@dataclass(frozen=True, slots=True)
class InThisProcess:
    """The acqd that is imported here; no page is drawn, which takes as long as the loop."""

    def build(
        self, power: Path, logs: Path, robot: Path, out: Path, *, lag_s: float | None, cut_s: float | None,
        worked_min: float = 0.0,
    ) -> None:  # fmt: skip
        """As `acqd dataset build`."""
        from acqd.dataset.build import build
        from acqd.dataset.config import BuildConfig

        config = BuildConfig(str(power), logs, out, str(robot), lag_s=lag_s, cut_s=cut_s, worked_min=worked_min)
        with refusals("dataset build"):
            build(config, lambda *_: None)

    def train(self, dataset: Path, bundle: Path) -> None:
        """As `acqd train`."""
        from acqd.models.config import TrainConfig
        from acqd.models.training import train_one

        with refusals("train"):
            train_one(TrainConfig(dataset, NETWORK, bundle), lambda *_: None)

    def close(self, dataset: Path, bundle: Path, out: Path) -> dict[str, Any]:
        """As `acqd close-loop --json`."""
        import orjson

        from acqd.discrepancy.config import CloseConfig
        from acqd.discrepancy.loop import close_loop
        from acqd.discrepancy.report.summary import as_json

        config = CloseConfig(dataset, bundle, out)
        with refusals("close-loop"):
            report = as_json(config, close_loop(config, lambda *_: None))
        return dict(json.loads(orjson.dumps(report, option=orjson.OPT_SERIALIZE_NUMPY)))


@contextmanager
def refusals(step: str) -> Iterator[None]:
    """acqd's refusals become StepErrors."""
    from acqd.errors import OperationError, UserError

    try:
        yield
    except (UserError, OperationError) as error:
        raise StepError(f"acqd {step}: {error}") from error


@dataclass(frozen=True, slots=True)
class Commands:
    """The commands of a source tree, as a user starts them, pages included."""

    tree: Path
    """Source tree of acqd."""
    folder: Path
    """Working directory."""

    def build(
        self, power: Path, logs: Path, robot: Path, out: Path, *, lag_s: float | None, cut_s: float | None,
        worked_min: float = 0.0,
    ) -> None:  # fmt: skip
        """`acqd dataset build`."""
        known = [*([] if lag_s is None else ["--lag", lag_s]), *([] if cut_s is None else ["--cut", cut_s])]
        known += ["--worked", worked_min] if worked_min else []
        self._acqd("dataset", "build", "--power", power, "--logs", logs, "--robot", robot, "--out", out, *known)

    def train(self, dataset: Path, bundle: Path) -> None:
        """`acqd train`."""
        self._acqd("train", dataset, "--network", NETWORK, "--out", bundle, "--jobs", 1)

    def close(self, dataset: Path, bundle: Path, out: Path) -> dict[str, Any]:
        """`acqd close-loop`."""
        printed = self._acqd("close-loop", dataset, "--model", bundle, "--out", out, "--json")
        return dict(json.loads(printed))

    def _acqd(self, *arguments: object) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "acqd", *map(str, arguments)], cwd=self.folder, env=environment(self.tree),
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            lines = done.stderr.strip().splitlines() or ["no message"]
            raise StepError(f"acqd {arguments[0]} ended with {done.returncode}: {' '.join(lines[-3:])}")
        return done.stdout


def environment(tree: Path | None) -> dict[str, str]:
    """Environment of acqd's processes: one thread each, and the source tree that is judged."""
    chosen = str(tree) if tree else os.environ.get("PYTHONPATH") or str(Path(__file__).resolve().parents[3])
    return os.environ | {"PYTHONPATH": os.pathsep.join(str(Path(part).resolve()) for part in chosen.split(os.pathsep)),
                         "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # fmt: skip


def judged_tree(tree: Path | None) -> str:
    """Folder of the acqd that is judged."""
    code = "import acqd, pathlib; print(pathlib.Path(acqd.__file__).parent)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd="/", env=environment(tree), stdout=subprocess.PIPE, text=True, check=True
    )
    return done.stdout.strip()
