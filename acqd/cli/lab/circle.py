"""From a robot in good order and a change to the report of the loop: the part of the circle that every run has."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from acqd.cli.lab.steps import Step, Steps

_MODEL = "grey-box-everything-s1"


@dataclass(frozen=True, slots=True)
class Circle:
    """Folders and commands of one circle."""

    steps: Steps
    robot: str

    @property
    def out(self) -> Path:
        """Folder of the circle."""
        return self.steps.out

    @property
    def model(self) -> Path:
        """Bundle of the robot in good order."""
        return self.out / "before.ds.models" / _MODEL

    @property
    def loop(self) -> Path:
        """Folder of the closing report."""
        return self.out / "after.ds.loop"

    def close(
        self, before: tuple[object, ...], after: tuple[object, ...], worked: tuple[object, ...] = ()
    ) -> dict[str, Any]:
        """report.json of the loop. `before`, `after`: further words of the campaigns; `worked`: of the first dataset.

        Commands that do not need each other run at the same time. Raises UserError, OperationError.
        """
        self.steps.run(*(self._campaign(name, words) for name, words in (("before", before), ("after", after))))
        sources = {name: (self.out / name / "power.sqlite", self.out / name / "logs") for name in ("before", "after")}
        since: dict[str, tuple[object, ...]] = {"before": worked, "after": ()}
        self.steps.run(*(self.dataset(f"{name}.ds", *files, *since[name]) for name, files in sources.items()))
        self.steps.run(Step.of(self.model, "train", self.out / "before.ds", "--network", "grey-box"))
        words = ("close-loop", self.out / "after.ds", "--model", self.model)
        self.steps.run(Step.of(self.loop / "report.json", *words))
        return report_of(self.loop)

    def dataset(self, name: str, power: Path, logs: Path, *more: object) -> Step:
        """Merging of a session."""
        words = ("--power", power, "--logs", logs, "--robot", self.robot, "--out", self.out / name, *more)
        return Step.of(self.out / name / "manifest.json", "dataset", "build", *words)

    def _campaign(self, name: str, words: tuple[object, ...]) -> Step:
        folder = self.out / name
        return Step.of(
            folder / "report.html", "lab", "campaign", "--out", folder, *words, "--robot", self.robot, "--jobs", 1
        )


def report_of(folder: Path) -> dict[str, Any]:
    """The report of a closing loop."""
    report: dict[str, Any] = orjson.loads((folder / "report.json").read_bytes())
    return report
