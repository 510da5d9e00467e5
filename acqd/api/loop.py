"""The closing loop: residual, effect, better model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from acqd.api.dataset import Dataset
from acqd.api.doubts import warn_of
from acqd.api.html import lines, table
from acqd.api.models import Model
from acqd.api.places import Place, path_of
from acqd.api.records import Effect, Parameter, Report, Verdict
from acqd.dataset.places import default_folder
from acqd.extras import LOOP, require
from acqd.report.digits import percent
from acqd.report.joint_names import all_with_joint_names


@dataclass(frozen=True, slots=True)
class LoopResult:
    """Result of a run of the loop: report.json, report.html and the repaired model, in a folder."""

    path: Path
    """Folder of the report."""
    report: Report
    """Contents of report.json."""

    @property
    def verdict(self) -> Verdict:
        """effects_found, nothing_left, unknown_structure or not_identifiable."""
        return self.report["verdict"]

    @property
    def effects(self) -> list[Effect]:
        """Effects that were found, each with id, where, parameters, confidence and rivals."""
        return list(self.report["effects"])

    def model(self) -> Model:
        """The repaired model."""
        return Model(self.path / "model")

    def _repr_html_(self) -> str:
        """For notebooks: the verdict, every effect with its parameters, and what the reader has to mind."""
        before, after = (self.report[key]["rmse"] for key in ("before", "after"))
        simulated = ", simulated" if self.report["measured"] == "simulated" else ""
        caption = f"{self.verdict.replace('_', ' ')}: RMSE {before:.2f} W before, {after:.2f} W after{simulated}"
        effects = all_with_joint_names(self.effects, self.report.get("joint_names", ()))
        rows = [
            (effect["id"], effect["where"], _in_words(effect["parameters"]), percent(effect["confidence"]),
             ", ".join(f"{rival['name']} {percent(rival['confidence'])}" for rival in effect["rivals"]) or "none")
            for effect in effects
        ]  # fmt: skip
        head = ("effect", "where", "size (95 % interval)", "confidence", "rivals")
        warnings = self.report["warnings"]
        others = [note for note in self.report["notes"] if note not in warnings]
        return table(caption, head, rows) + lines([*(f"mind: {warning}" for warning in warnings), *others])


def close_loop(
    dataset: Dataset | Place,
    model: Model | Place,
    out: Place | None = None,
    *,
    reference: Dataset | Place | None = None,
    max_effects: int = 5,
    only: Sequence[str] = (),
    exclude: Sequence[str] = (),
    seed: int = 1,
    robot: str | None = None,
    since: datetime | None = None,
) -> LoopResult:
    """Find the cause of a model's residual, add the cause to the model, report the error before and after.

    `dataset` has the recordings in question, `reference` those to compare with (default: what the model remembers);
    `out` defaults to DATASET.loop. `since` leaves out recordings that ended before. Warns of what the verdict has to be
    read with. Raises UserError, InputError, OperationError.

    >>> result = close_loop("now", "model", "loop", only=["payload"])
    >>> result.verdict, result.effects[0]["id"]
    ('effects_found', 'payload')
    """
    require("close_loop", LOOP, "loop")
    import orjson

    from acqd.atomic import require_free
    from acqd.discrepancy.config import CloseConfig
    from acqd.discrepancy.loop import close_loop as close
    from acqd.discrepancy.report.write import write_all

    folder = _folder(dataset)
    config = CloseConfig(
        dataset=folder,
        bundle=model.path if isinstance(model, Model) else path_of(model),
        out=default_folder(folder, "loop") if out is None else path_of(out),
        reference=None if reference is None else _folder(reference),
        max_effects=max_effects,
        only=tuple(only),
        exclude=tuple(exclude),
        seed=seed,
        robot=robot,
        since_s=None if since is None else since.timestamp(),
    )
    require_free(config.out, "report.json", "report")
    write_all(config, close(config, lambda *_: None))
    result = LoopResult(config.out, orjson.loads((config.out / "report.json").read_bytes()))
    warn_of(result.report["warnings"])
    return result


def _in_words(parameters: dict[str, Parameter]) -> str:
    parts = []
    for name, one in parameters.items():
        ends = "" if one["ci95"] is None else f" ({one['ci95'][0]:.3g} to {one['ci95'][1]:.3g})"
        parts.append(f"{name} {one['value']:.3g} {one['unit']}{ends}")
    return "; ".join(parts)


def _folder(dataset: Dataset | Place) -> Path:
    return dataset.path if isinstance(dataset, Dataset) else path_of(dataset)
