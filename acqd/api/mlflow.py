"""A bundle as a model of MLflow (flavour `pyfunc`). Needs the extra `mlflow`.

The bundle is stored as it is, with this module as its loader: nothing is pickled, so that another version of Python can
open a model of a registry.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd import __version__
from acqd.api.models import Model
from acqd.api.places import Place
from acqd.errors import UserError
from acqd.extras import install_command

try:
    import mlflow
    import mlflow.pyfunc
    import pandas
    from mlflow.models import ModelSignature
    from mlflow.models.model import ModelInfo
    from mlflow.types import ColSpec, DataType, Schema
except ModuleNotFoundError:
    raise UserError(f"a model of MLflow needs mlflow-skinny and pandas: {install_command('mlflow')}") from None

_RECORDING = "recording"


class PowerModel:
    """What `mlflow.pyfunc.load_model` returns predictions of."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def predict(
        self,
        model_input: pandas.DataFrame,
        params: dict[str, object] | None = None,  # noqa: ARG002 - MLflow's call
    ) -> pandas.DataFrame:
        """A DataFrame with the mains power `P` [W], one row for each row of the input.

        Input: a DataFrame with the joint angles q1 ... [rad], rows `step_s` apart in the order of time; the logged
        signals that the model uses, if known; `recording`, if there are several. Raises UserError.
        """
        frame = model_input
        angles = [f"q{k + 1}" for k in range(self.model.axes)]
        missing = [name for name in angles if name not in frame]
        if missing:
            raise UserError(f"the input lacks {', '.join(missing)}; it has {', '.join(map(str, frame.columns))}")
        signals = [name for name in self.model.predictor.signals if name in frame]
        known = signals if len(signals) == len(self.model.predictor.signals) else []
        groups = frame[_RECORDING] if _RECORDING in frame else pandas.Series("", index=frame.index)
        P = np.empty(len(frame))
        for recording in groups.unique():
            rows = np.flatnonzero(groups == recording)
            part = frame.iloc[rows]
            P[rows] = self.model.predict(part[angles].to_numpy(float), part[known].to_numpy(float) if known else None)
        return pandas.DataFrame({"P": P}, index=frame.index)


def save_model(bundle: Model | Place, path: Place, **more: Any) -> None:
    """Write a bundle as a model of MLflow; `more`: what `mlflow.pyfunc.save_model` takes. Raises UserError, InputError.

    >>> save_model("model", "saved")
    >>> table = Dataset("ds").to_pandas()
    >>> mlflow.pyfunc.load_model("saved").predict(table[["q1", "q2", "q3", "q4", "q5", "q6"]]).columns.tolist()
    ['P']
    """
    mlflow.pyfunc.save_model(str(path), **_arguments(_opened(bundle)), **more)


def log_model(bundle: Model | Place, name: str = "power", **more: Any) -> ModelInfo:
    """Log a bundle to the active run of MLflow, with metrics of its test split; returns MLflow's ModelInfo.

    `more`: what `mlflow.pyfunc.log_model` takes, `registered_model_name` for one. Raises UserError, InputError.
    """
    model = _opened(bundle)
    logged = mlflow.pyfunc.log_model(name=name, **_arguments(model), **more)
    metrics = model.metadata["metrics"]["test"] if "metrics" in model.metadata else None
    numbers = {key: float(value) for key, value in (metrics or {}).items() if isinstance(value, int | float)}
    mlflow.log_metrics({f"test_{key}": value for key, value in numbers.items() if np.isfinite(value)})
    return logged


def open_model(uri: str) -> Model:
    """The bundle in a model of MLflow, by its folder or URI (runs:/..., models:/...), as acqd opens it.

    Raises UserError, InputError.
    """
    folder = Path(mlflow.artifacts.download_artifacts(uri))
    about = mlflow.models.Model.load(str(folder)).flavors.get(mlflow.pyfunc.FLAVOR_NAME, {})
    if about.get(mlflow.pyfunc.MAIN) != __name__:
        raise UserError(f"{uri}: is a model of MLflow, but not one that acqd.api.mlflow has written")
    return Model(folder / about[mlflow.pyfunc.DATA])


def _load_pyfunc(data_path: str) -> PowerModel:
    """MLflow calls this with the folder of the bundle."""
    return PowerModel(Model(data_path))


def _opened(bundle: Model | Place) -> Model:
    return bundle if isinstance(bundle, Model) else Model(bundle)


def _arguments(model: Model) -> dict[str, Any]:
    """Of `save_model` and `log_model` of MLflow."""
    metadata = model.metadata
    about = {key: metadata.get(key) for key in ("kind", "name", "robot", "axes", "step_s")} | {"acqd": __version__}
    return {
        "loader_module": __name__,
        "data_path": str(model.path),
        "signature": _signature(model),
        "metadata": about,
        "pip_requirements": [f"acqd[mlflow]=={__version__}"],
    }


def _signature(model: Model) -> ModelSignature:
    angles = [ColSpec(DataType.double, f"q{k + 1}") for k in range(model.axes)]
    signals = [ColSpec(DataType.double, name, required=False) for name in model.predictor.signals]
    recording = ColSpec(DataType.string, _RECORDING, required=False)
    return ModelSignature(Schema([*angles, *signals, recording]), Schema([ColSpec(DataType.double, "P")]))
