"""Files and results of a plant's cases."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.studies.foreign.cases import Case, World, make_after, make_before
from tools.studies.foreign.steps import Commands, InThisProcess, StepError, Steps, judged_tree

_WORKED_MIN = 60.0
"""Work before the session before: its gears have 0.9 to 1.0 of their working warmth (`generator.plant`)."""


@dataclass(frozen=True, slots=True)
class Runner:
    """Where files lie, and which acqd is judged."""

    out: Path
    world: World
    label: str
    """Folder of this acqd's datasets, models and results."""
    tree: Path | None
    """Source tree of the acqd whose commands are judged; None: the acqd that is imported here, without its pages."""

    @property
    def steps(self) -> Steps:
        """What is judged."""
        return InThisProcess() if self.tree is None else Commands(self.tree, self.work)

    @property
    def data(self) -> Path:
        """Generated files: they do not depend on acqd."""
        return self.out / self.world.name / "data"

    @property
    def work(self) -> Path:
        """What acqd made of them."""
        return self.out / self.world.name / self.label

    def result_file(self, case: Case) -> Path:
        """The result of a case."""
        return self.work / "results" / f"{case.name}.json"

    def run(self, case: Case) -> dict[str, Any]:
        """The result of a case; a case that was done is not done again."""
        done = self.result_file(case)
        if done.exists():
            return dict(json.loads(done.read_text()))
        begun = time.monotonic()
        truth = make_after(self.world, case, self.data / case.name)
        seconds = {"generate": time.monotonic() - begun}
        result: dict[str, Any] = {
            "case": case.name, "strength": case.strength, "world": self.world.name, "axes": self.world.axes,
            "seed": self.world.seed, "amount": self.world.amount, "torques": self.world.torques,
            "truth": truth["effects"], "clock": truth["clock"], "error": None, "report": None,
            "lag_errors_s": {},
        }  # fmt: skip
        try:
            result["report"] = self._loop(case, seconds)
            result["lag_errors_s"] = self._lag_errors(case, truth["lags_s"])
        except StepError as error:
            result["error"] = str(error)
        result["seconds"] = seconds
        done.parent.mkdir(parents=True, exist_ok=True)
        partial = done.with_suffix(f".{os.getpid()}.partial")
        partial.write_text(json.dumps(result))
        partial.rename(done)
        return result

    def prepare(self) -> Path:
        """The model of the plant as it was before, which all its cases share. Raises StepError."""
        self._require_this_generator()
        bundle = self.work / "model"
        if bundle.exists():
            return bundle
        self.work.mkdir(parents=True, exist_ok=True)
        files = make_before(self.world, _parent(self.data) / "before")
        dataset = self.work / "before.ds"
        shutil.rmtree(dataset, ignore_errors=True)
        self.build(files, dataset, worked_min=_WORKED_MIN)
        self.steps.train(dataset, bundle)
        return bundle

    def forget(self, cases: Sequence[Case]) -> None:
        """Remove the model and the results of some cases; the generated files stay."""
        for folder in ("model", "before.ds"):
            shutil.rmtree(self.work / folder, ignore_errors=True)
        for case in cases:
            self.result_file(case).unlink(missing_ok=True)

    def _require_this_generator(self) -> None:
        """Files of two versions of the generator are not to be mixed."""
        marker = _parent(self.out / self.world.name) / "generator.sha256"
        if not marker.exists():
            marker.write_text(generator_digest())
        if marker.read_text() != generator_digest():
            raise StepError(f"{marker.parent} was made by another version of the generator: choose another OUT")

    def _loop(self, case: Case, seconds: dict[str, float]) -> dict[str, Any]:
        bundle = self.prepare()
        folder = self.work / "cases" / case.name
        shutil.rmtree(folder, ignore_errors=True)
        begun = time.monotonic()
        self.build(self.data / case.name, folder / "ds")
        seconds["build"] = time.monotonic() - begun
        begun = time.monotonic()
        report = self.steps.close(folder / "ds", bundle, folder / "loop")
        seconds["close"] = time.monotonic() - begun
        report.pop("thresholds", None)
        return report

    def _lag_errors(self, case: Case, lags_s: dict[str, float]) -> dict[str, float]:
        """Lag that acqd took minus the true one, s per recording; the dataset is removed."""
        dataset = self.work / "cases" / case.name / "ds"
        manifest = json.loads((dataset / "manifest.json").read_text())
        shutil.rmtree(dataset)
        return {entry["name"]: entry["lag_s"] - lags_s[entry["name"]] for entry in manifest["recordings"]}

    def build(self, files: Path, dataset: Path, cut_s: float | None = None, worked_min: float = 0.0) -> None:
        """A dataset of the files of a session, after so much work. Raises StepError."""
        dataset.parent.mkdir(parents=True, exist_ok=True)
        lag_s = None if self.world.own_clocks else 0.0
        self.steps.build(
            files / "power.csv", files / "logs", self._description(), dataset, lag_s=lag_s, cut_s=cut_s,
            worked_min=worked_min,
        )  # fmt: skip

    def _description(self) -> Path:
        """The shipped description; that it may be 20 % wrong is said, because no masses of these plants are exact."""
        own = self.work / f"{self.world.robot}.toml"
        if not own.exists():
            shipped = Path(judged_tree(self.tree)) / "robot" / "descriptions" / own.name
            partial = own.with_suffix(f".{os.getpid()}.partial")
            partial.write_text(shipped.read_text().replace("mass_deviation = 0.1 ", "mass_deviation = 0.2 "))
            partial.rename(own)
        return own


def generator_digest() -> str:
    """SHA-256 of the generator's source."""
    digest = hashlib.sha256()
    for path in sorted((Path(__file__).parent / "generator").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def result_files(out: Path, label: str) -> list[Path]:
    """Results of all plants under a label."""
    return sorted(out.glob(f"*/{label}/results/*.json"))


def _parent(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder
