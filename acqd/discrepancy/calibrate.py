"""The scale of a model's torques from a move with a known mass, written into the model's bundle."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from acqd.atomic import complete_folder
from acqd.discrepancy.another_time import another_time
from acqd.discrepancy.averaging import with_like_means
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.recordings import subject_of
from acqd.discrepancy.repair.terms import FIRST_MOMENT, reported
from acqd.discrepancy.repair.torque_scale import GUESSED_DRIVE_DEVIATION, KEY, TorqueScale
from acqd.discrepancy.search import search
from acqd.discrepancy.selection.accepted import Selected, Selection
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import UserError
from acqd.models.bundle.bundle import require_made_again
from acqd.models.effects import library

_LEAST_KNOWN = GUESSED_DRIVE_DEVIATION
"""Greatest relative deviation of a scale that is worth keeping: guessed drives are known as well."""

_SAY_CENTRE = ", or say with --centre how far beyond the flange its centre is"


@dataclass(frozen=True, slots=True)
class Calibration:
    """What a known mass says about a model."""

    known_kg: float
    model_kg: float
    """The mass in the scale of the model; where the lever is known, the mass that has the first moment it sees."""
    scale: TorqueScale
    where: str
    out: Path
    notes: tuple[str, ...] = ()
    """What was done to the power before it was compared."""

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        half = THRESHOLDS.interval_width * self.scale.deviation
        return {
            "out": str(self.out), "known_mass_kg": self.known_kg, "mass_of_model_kg": self.model_kg,
            "where": self.where, "notes": list(self.notes),
            KEY: {"value": self.scale.value, "ci95": [self.scale.value - half, self.scale.value + half]},
        }  # fmt: skip


def calibrate(
    config: CloseConfig,
    known_kg: float,
    progress: Callable[[str, float], None],
    centre_m: float | None = None,
) -> Calibration:
    """The torques of the model `config.bundle` over the true ones, by recordings with `known_kg` at the flange.

    `centre_m`: how far beyond the flange the centre of the mass is. Where the flange is beside the last axis, gravity
    shows mass times lever, which is known much better than both.

    The model must have learned from recordings without the mass, or the mass be there while the tool is on. The copy
    of the bundle at `config.out` holds the scale. Raises UserError where the mass does not show.
    """
    if not (math.isfinite(known_kg) and known_kg > 0):
        raise UserError(f"--known-mass {known_kg:g}: expected the mass at the flange, in kg, above 0")
    require_made_again(config.out, lambda earlier: KEY in earlier)
    subject = subject_of(config, progress)
    if mistimed := another_time(subject):
        raise UserError(f"{config.dataset}: {mistimed}")
    subject, notes = with_like_means(subject)
    _, selection = search(config, subject, progress)
    payloads = [each for each in selection.effects if library()[each.id].known_mass]
    if not payloads:
        raise UserError(
            f"{config.dataset}: {known_kg:g} kg at the flange do not show in the power; record the same motion with a "
            "larger mass, arm stretched out, against a model of recordings without the mass (--model)"
        )
    found = reported(selection, payloads[0], TorqueScale(1.0, 0.0))
    lever_m = _lever(selection, payloads[0], centre_m)
    moment = found.term.parameters.get(FIRST_MOMENT)
    seen, per = (moment, lever_m) if moment and lever_m else (found.term.parameters["mass"], 1.0)
    value, low, high = (each / per for each in (seen["value"], *seen["ci95"]))
    scale = TorqueScale(value / known_kg, (high - low) / 2 / THRESHOLDS.interval_width / known_kg)
    if scale.value <= 0 or scale.deviation > _LEAST_KNOWN * scale.value:
        raise UserError(
            f"{config.dataset}: the model sees {value:.3g} kg ({low:.3g} to {high:.3g} kg) for {known_kg:g} kg, which "
            f"is too uncertain; record more motion, and a larger mass{'' if lever_m or not moment else _SAY_CENTRE}"
        )
    _write(config, known_kg, scale)
    return Calibration(known_kg, value, scale, found.term.where, config.out, tuple(notes))


def _lever(selection: Selection, payload: Selected, centre_m: float | None) -> float | None:
    """m from the last axis to a mass at `centre_m` beyond the flange; None where the mass is on the axis."""
    if centre_m is None:
        return None
    model = selection.design.columns.model
    return library()[payload.id].lever(model, payload.place, dict(payload.shape) | {"centre_of_mass_m": centre_m})


def _write(config: CloseConfig, known_kg: float, scale: TorqueScale) -> None:
    with complete_folder(config.out) as folder:
        shutil.copytree(config.bundle, folder, dirs_exist_ok=True)
        file = folder / "bundle.json"
        metadata = orjson.loads(file.read_bytes())
        metadata[KEY] = {
            "value": scale.value, "deviation": scale.deviation, "known_mass_kg": known_kg,
            "dataset": str(config.dataset),
        }  # fmt: skip
        file.write_bytes(orjson.dumps(metadata, option=orjson.OPT_INDENT_2))
