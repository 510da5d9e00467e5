"""Predictors from bundles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError, UserError
from acqd.models.augmented import Augmented, Term
from acqd.models.bundle.bundle import Bundle, load_bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.greybox.bundle_io import restore as restore_grey_box
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.bundle_io import restore_hybrid
from acqd.models.networks.architecture import architecture
from acqd.models.networks.predictor import NetworkPredictor
from acqd.models.normalisation import Normalisation
from acqd.models.predictor import Predictor


def open_model(path: Path) -> tuple[Bundle, Predictor]:
    """Read a bundle and make its predictor. Raises InputError."""
    bundle = load_bundle(path)
    try:
        model = restore(bundle)
        _check(model)
        if "envelope" in bundle.metadata:
            Envelope.from_json(bundle.metadata["envelope"])
        return bundle, model
    except Exception as error:  # whatever a damaged bundle makes the models raise
        reason = f"{type(error).__name__}: {error}" if not isinstance(error, UserError) else str(error)
        raise InputError(path, f"does not hold what its kind of model needs ({reason}); train it again") from None


def _check(model: Predictor) -> None:
    """Predict a few rows: arrays of a wrong shape raise ValueError or IndexError."""
    if not 0 < model.step_s < 3600:
        raise ValueError(f"a step of {model.step_s} s")
    rows = 2 * model.radius + 3
    signals = np.tile(model.usual_signals(), (rows, 1))
    if signals.shape[1] != len(model.signals):
        raise ValueError(f"{signals.shape[1]} usual values for {len(model.signals)} signals")
    if not np.isfinite(model.sequence(np.zeros((rows, model.axes)), signals)).all():
        raise ValueError("its predictions are not finite")


def restore(bundle: Bundle) -> Predictor:
    """The predictor of a bundle, with its added effects. Raises UserError, KeyError, ValueError."""
    base = _base(bundle)
    terms = [_term(effect) for effect in bundle.metadata.get("effects", [])]
    return Augmented(base, carrier_of(bundle, base), terms) if terms else base


def _term(content: dict[str, Any]) -> Term:
    """An added effect. Raises KeyError, ValueError.

    Numpy counts a negative column from the end, and C writes before the array.
    """
    columns = content["columns"]
    if not all(type(column) is int and column >= 0 for column in columns):
        raise ValueError(f"effect {content['id']}: columns {columns!r:.60} are not all numbers from 0 on")
    if len(columns) != len(content["coefficients"]):
        raise ValueError(f"effect {content['id']}: {len(columns)} columns and other numbers of coefficients")
    return Term.from_json(content)


def carrier_of(bundle: Bundle, base: Predictor) -> GreyBox:
    """The grey box on whose torques added effects act: a network's carrier, or `base` itself. Raises ValueError."""
    if "carrier" in bundle.metadata:
        arrays = {name.removeprefix("carrier."): a for name, a in bundle.arrays.items() if name.startswith("carrier.")}
        return restore_grey_box(bundle.metadata | bundle.metadata["carrier"], arrays)
    if isinstance(base, GreyBox):
        return base
    raise ValueError("effects without a grey box to act on")


def _base(bundle: Bundle) -> Predictor:
    metadata, arrays = bundle.metadata, bundle.arrays
    if metadata["kind"] == "grey_box":
        return restore_grey_box(metadata, arrays)
    if metadata["kind"] == "hybrid":
        return restore_hybrid(metadata, arrays)
    if metadata["kind"] != "network":
        raise UserError(f"unknown kind of model {metadata['kind']!r}")
    chosen = architecture(metadata["architecture"]["name"])
    parameters = np.asarray(arrays["theta"], dtype=np.float32)
    if len(parameters) != chosen.learnables(metadata["axes"]):
        raise UserError(f"{len(parameters)} learnables where {chosen.name} has {chosen.learnables(metadata['axes'])}")
    return NetworkPredictor(
        chosen,
        int(metadata["axes"]),
        float(metadata["step_s"]),
        parameters,
        Normalisation.from_json(metadata["normalisation"]),
    )
