"""Models: opened, trained, applied, exported."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from acqd.api.dataset import Dataset
from acqd.api.doubts import warn_of
from acqd.api.html import table
from acqd.api.places import Place, path_of
from acqd.api.records import Metadata
from acqd.dataset.places import default_models
from acqd.errors import UserError
from acqd.extras import require

if TYPE_CHECKING:
    from acqd.api.records import Errors
    from acqd.arrays import Floats
    from acqd.models.predict import Prediction
    from acqd.robot.log import RobotLog


class Model:
    """A trained model of a robot's mains power, from a bundle on disk."""

    def __init__(self, bundle: Place) -> None:
        """Open a bundle. Raises InputError, UserError."""
        require("open_model", ("safetensors", "scipy"), "predict")
        from acqd.models.bundle.restore import open_model as read

        self.path: Path = path_of(bundle)
        self.bundle, self.predictor = read(self.path)

    @property
    def metadata(self) -> Metadata:
        """bundle.json: kind, robot, metrics, and further keys (inputs, envelope, provenance)."""
        return cast("Metadata", self.bundle.metadata)

    @property
    def axes(self) -> int:
        """Number of joints."""
        return self.predictor.axes

    @property
    def step_s(self) -> float:
        """Time between rows, s."""
        return self.predictor.step_s

    def predict(self, q: Floats, signals: Floats | None = None) -> Floats:
        """Power [T] W of joint angles [T, axes] rad, `step_s` apart, and signals [T, k] (None: the usual values).

        Raises UserError for arrays of another shape.
        """
        angles = np.asarray(q, dtype=np.float64)
        if angles.ndim != 2 or angles.shape[1] != self.axes or not len(angles):
            raise UserError(f"q has the shape {angles.shape}, expected [rows, {self.axes}]")
        if signals is not None and np.shape(signals) != (len(angles), len(self.predictor.signals)):
            raise UserError(
                f"signals have the shape {np.shape(signals)}, expected {(len(angles), len(self.predictor.signals))}: "
                f"{', '.join(self.predictor.signals) or 'this model has none'}"
            )
        return self.predictor.recording(angles, None if signals is None else np.asarray(signals, dtype=np.float64))

    def __repr__(self) -> str:
        return f"Model({str(self.path)!r})"

    def _repr_html_(self) -> str:
        """For notebooks: errors on the parts of the data that the model was trained with."""
        about = self.metadata
        metrics = cast("dict[str, Errors | None]", about["metrics"])
        rows = [(part, f"{errors['mae']:.2f}", f"{errors['rmse']:.2f}") for part, errors in metrics.items() if errors]
        origin = f", {about['measured']} power" if "measured" in about else ""
        caption = f"{self.path.name}: {about['kind']} of {about['robot']}, {self.axes} axes, {self.step_s:g} s{origin}"
        return table(caption, ("part", "MAE [W]", "RMSE [W]"), rows)


def open_model(bundle: Place) -> Model:
    """The model in the folder `bundle`. Raises InputError, UserError.

    >>> model = open_model("model")
    >>> model.axes, model.metadata["kind"]
    (6, 'grey_box')
    >>> model.predict(np.zeros((100, 6))).shape
    (100,)
    """
    return Model(bundle)


def predict(model: Model | Place, log: RobotLog | Place, *, robot: str | None = None) -> Prediction:
    """Power of a robot log, with a flag on rows outside the range of the training data.

    `robot`: a description other than the model's. Raises InputError, UserError.

    >>> prediction = predict("model", "logs/example.csv")
    >>> prediction.P.shape == prediction.outside.shape == prediction.time.shape
    True
    """
    opened = model if isinstance(model, Model) else Model(model)
    from acqd.models.predict import predict as predict_read
    from acqd.models.predict import predict_log
    from acqd.robot.log import RobotLog

    if isinstance(log, RobotLog):
        prediction = predict_read(opened.bundle, opened.predictor, log)
    else:
        prediction = predict_log(opened.bundle, opened.predictor, path_of(log), robot)
    warn_of([prediction.note])
    return prediction


def train(
    dataset: Dataset | Place,
    network: str = "grey-box",
    *,
    out: Place | None = None,
    kinds: Sequence[str] = (),
    seed: int = 1,
    robot: str | None = None,
    epochs: int = 2000,
    patience: int | None = None,
) -> Model:
    """Train a model and write its bundle (default: next to the dataset, as `acqd train` does).

    `network` is grey-box, hybrid, or one of the eight networks; `kinds` of trajectories (empty: all); `epochs` and
    `patience` concern networks. Raises UserError, InputError, OperationError.

    >>> model = train("ds", out="trained")
    >>> model.metadata["metrics"]["test"]["rmse"] < 3  # W, simulated
    True
    """
    require("train", ("scipy", "safetensors"), "data,predict")
    from acqd.models.config import TrainConfig
    from acqd.models.networks.settings import TrainingSettings
    from acqd.models.training import bundle_name, train_one

    folder = dataset.path if isinstance(dataset, Dataset) else path_of(dataset)
    chosen = tuple(kinds)
    path = default_models(folder) / bundle_name(network, chosen, seed) if out is None else path_of(out)
    settings = TrainingSettings(epochs=epochs, patience=patience)
    train_one(TrainConfig(folder, network, path, chosen, seed, settings, robot), lambda *_: None)
    return Model(path)


def export_fmu(
    model: Model | Place,
    out: Place,
    *,
    fmi: Literal["2.0", "3.0"] = "2.0",
    platforms: Sequence[str] = (),
) -> Path:
    """Export a model as an FMU for co-simulation, compiled for `platforms` (empty: this one). Returns the file.

    Raises UserError, InputError, OperationError.

    >>> export_fmu("model", "power.fmu").name
    'power.fmu'
    """
    require("export_fmu", ("scipy", "safetensors"), "predict")
    from acqd.fmu.package import export_fmu as export
    from acqd.fmu.platforms import here

    bundle = model.path if isinstance(model, Model) else path_of(model)
    return export(bundle, path_of(out), fmi, list(platforms) or [here()], lambda _: None).path


def export_onnx(model: Model | Place, out: Place) -> Path:
    """Export a network as ONNX: joint angles `q` [T, axes] rad, `step_s` apart, to power `P` [T] W. Returns the file.

    Raises UserError for other models, InputError, OperationError.
    """
    require("export_onnx", ("onnx", "safetensors", "scipy"), "onnx")
    from acqd.models.networks.onnx_file import export_onnx as export

    opened = model if isinstance(model, Model) else Model(model)
    path = path_of(out)
    export(opened.bundle, opened.predictor, path)
    return path
