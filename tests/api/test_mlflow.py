"""A bundle in MLflow: saved, logged with its metrics, opened again, and its predictions those of the bundle."""

import numpy as np
import pytest

import acqd

mlflow = pytest.importorskip("mlflow", reason="pip install 'acqd[mlflow]'")
pytest.importorskip("pandas", reason="pip install 'acqd[mlflow]'")
ANGLES = [f"q{k + 1}" for k in range(6)]


def test_a_saved_bundle_predicts_as_before_and_names_its_columns(folder):
    from acqd.api.mlflow import open_model, save_model

    save_model("model", "saved")
    loaded, model = mlflow.pyfunc.load_model("saved"), acqd.open_model("model")
    signals = list(model.predictor.signals)
    frame = acqd.Dataset("ds").to_pandas().query("valid")
    predicted = loaded.predict(frame[[*ANGLES, *signals, "recording"]])
    assert predicted.columns.tolist() == ["P"] and (predicted.index == frame.index).all()
    for name, part in frame.groupby("recording"):
        known = part[signals].to_numpy(float) if signals else None
        expected = model.predict(part[ANGLES].to_numpy(float), known)
        np.testing.assert_array_equal(predicted.loc[part.index, "P"], expected, err_msg=str(name))
    names = [column.name for column in loaded.metadata.signature.inputs]
    assert names == [*ANGLES, *signals, "recording"]
    assert open_model("saved").metadata == model.metadata


def test_missing_angles_are_named(folder):
    from acqd.api.mlflow import PowerModel

    with pytest.raises(acqd.UserError, match="lacks q6"):
        PowerModel(acqd.open_model("model")).predict(acqd.Dataset("ds").to_pandas()[ANGLES[:5]])


def test_a_run_holds_the_bundle_and_its_metrics(folder, monkeypatch):
    from acqd.api.mlflow import log_model, open_model

    monkeypatch.setenv("MLFLOW_ALLOW_FILE_STORE", "true")
    mlflow.set_tracking_uri(f"file://{folder}/mlruns")
    try:
        with mlflow.start_run() as run:
            logged = log_model("model")
        data = mlflow.get_run(run.info.run_id).data
        model = acqd.open_model("model")
        assert data.metrics["test_rmse"] == pytest.approx(model.metadata["metrics"]["test"]["rmse"])
        assert open_model(logged.model_uri).metadata == model.metadata
        frame = acqd.Dataset("ds").to_pandas().query("valid")[ANGLES]
        predicted = mlflow.pyfunc.load_model(logged.model_uri).predict(frame)
        np.testing.assert_array_equal(predicted["P"], model.predict(frame.to_numpy(float)))
    finally:
        mlflow.set_tracking_uri(None)
