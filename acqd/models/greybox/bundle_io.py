"""Training of grey boxes, and their entries in bundles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from acqd.errors import UserError
from acqd.models.bundle.bundle import Arrays
from acqd.models.config import Progress, TrainConfig, TrainedModel
from acqd.models.greybox.model import TERMS, GreyBox
from acqd.models.greybox.parameters import Layout, table
from acqd.robot.description import load_description
from acqd.robot.newton_euler import Chain

if TYPE_CHECKING:
    from acqd.models.greybox.fit import Fit
    from acqd.models.segments import Dataset

_FIXED_SIGN_SPEED = 0.02
"""rad/s, in bundles of versions that did not estimate the speed: the last parameter is missing there."""


def train_grey_box(config: TrainConfig, data: Dataset, progress: Progress) -> TrainedModel:
    """Fit a grey box. Raises UserError."""
    fit = fitted(config, data, progress)
    metadata = describe(fit) | ({"withheld": list(config.withheld)} if config.withheld else {})
    metadata |= learned_from(config)
    arrays = arrays_of(fit.model) | fit.likelihood.arrays()
    return TrainedModel("grey_box", fit.model, metadata, arrays, "Gauss-Newton")


def learned_from(config: TrainConfig) -> dict[str, Any]:
    """The entry of bundle.json about the prior of other robots."""
    return {} if config.learned is None else {"prior": config.learned.provenance()}


def fitted(config: TrainConfig, data: Dataset, progress: Progress) -> Fit:
    """The fit of a grey box with its covariance. Raises UserError when robot and dataset differ in axes."""
    from acqd.models.greybox.fit import fit_grey_box

    robot = load_description(config.robot or data.description)
    if robot.axes != data.axes:
        raise UserError(
            f"{config.dataset}: has {data.axes} axes, {robot.name} has {robot.axes}; choose another --robot"
        )
    if config.learned is not None and config.learned.robot != data.robot:
        raise UserError(
            f"{config.dataset} is of {data.robot}, the prior of {config.learned.robot}; name another --prior"
        )
    training = data.part("train", config.kinds)
    return fit_grey_box(
        robot,
        training,
        data.step_s,
        config.seed,
        lambda share: progress("fitting the grey box", share, float("nan")),
        config.withheld,
        config.learned,
    )


def describe(fit: Fit) -> dict[str, Any]:
    """Terms, signals and parameters for bundle.json."""
    sliding = {"sliding": list(fit.model.layout.sliding)} if fit.model.layout.sliding else {}
    return sliding | {
        "terms": [*TERMS, "signals", "standby"],
        "signals": list(fit.model.signals),
        "sigma_W": fit.sigma_W,
        "parameters": table(fit.model.layout, fit.model.values, fit.covariance),
    }


def arrays_of(model: GreyBox) -> Arrays:
    """Arrays for weights.safetensors."""
    return {
        "parameters": model.values,
        "chain_xyz": model.chain.xyz,
        "chain_rotation": model.chain.rotation,
        "chain_axis": model.chain.axis,
        "chain_tip": model.chain.tip,
        "usual_signals": model.usual_signals(),
    }


def restore(metadata: dict[str, Any], arrays: Arrays) -> GreyBox:
    """The grey box of a bundle. Raises KeyError or ValueError when an array is missing or has a wrong shape."""
    sliding = tuple(int(k) for k in metadata.get("sliding", ()))
    chain = Chain(arrays["chain_xyz"], arrays["chain_rotation"], arrays["chain_axis"], arrays["chain_tip"], sliding)
    layout = Layout(int(metadata["axes"]), tuple(metadata["signals"]), sliding)
    values = np.asarray(arrays["parameters"], dtype=np.float64)
    estimated = {entry["name"] for entry in metadata.get("parameters", ())}
    if len(values) == layout.size - 1 and "sign_speed" not in estimated:
        values = np.append(values, _FIXED_SIGN_SPEED)
    if len(values) != layout.size or len(chain.xyz) != layout.axes:
        raise ValueError(
            f"{len(values)} parameters and {len(chain.xyz)} joints, expected {layout.size} and {layout.axes}"
        )
    shapes = [chain.xyz.shape, chain.rotation.shape, chain.axis.shape, chain.tip.shape]
    if shapes != [(layout.axes, 3), (layout.axes, 3, 3), (layout.axes, 3), (2, 3)]:
        raise ValueError(f"a kinematic chain of shapes {shapes}")
    return GreyBox(chain, layout, values, float(metadata["step_s"]), arrays["usual_signals"])
