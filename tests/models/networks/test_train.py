"""Training of networks."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.models.metrics import measure, predictions
from acqd.models.networks.architecture import architecture
from acqd.models.networks.settings import TrainingSettings
from acqd.models.networks.train import train
from tests.models.motions import dataset, iiwa_power


def small(data, tmp_path, epochs, checkpoint="c", **options):
    chosen = TrainingSettings(epochs=epochs, validation_every=3, **options)
    return train(architecture("14x1dim"), data, (), 5, chosen, tmp_path / checkpoint, lambda at: None)


def test_training_learns_and_goes_on_after_it_was_stopped(tmp_path, monkeypatch):
    data = dataset(iiwa_power, count=8, rows=200)
    seen = data.part("train")
    P = np.concatenate([s.P for s in seen])
    chosen = TrainingSettings(epochs=200)
    learnt = train(
        architecture("14x1dim"),
        replace(data, segments=[*seen, *(replace(s, split="validation") for s in seen)]),
        (),
        5,
        chosen,
        tmp_path / "learnt",
        lambda at: None,
    )
    assert measure(predictions(learnt.predictor, seen), seen).mae < 0.5 * np.abs(P - P.mean()).mean()
    whole = small(data, tmp_path, 30)
    monkeypatch.setattr("acqd.models.networks.train._SAVE_EVERY_S", 0.0)

    class StoppedError(Exception):
        pass

    def stop(at):
        if at.epoch == 11:
            raise StoppedError

    settings_ = TrainingSettings(epochs=30, validation_every=3)
    with pytest.raises(StoppedError):
        train(architecture("14x1dim"), data, (), 5, settings_, tmp_path / "again", stop)
    assert (tmp_path / "again").exists()
    begun = []
    resumed = train(
        architecture("14x1dim"), data, (), 5, settings_, tmp_path / "again", lambda at: begun.append(at.epoch)
    )
    assert begun[0] == 11  # the tenth was saved
    assert np.array_equal(resumed.parameters, whole.parameters) and resumed.run.best_loss == whole.run.best_loss


@pytest.mark.xdist_group("torch")
def test_torch_trains_to_the_same_place(tmp_path):
    data = dataset(iiwa_power, count=8, rows=120)
    fused, portable = (small(data, tmp_path, 4, name, compute=name) for name in ("fused", "torch"))
    assert "torch" in portable.engine and "fused" in fused.engine
    assert np.abs(fused.parameters - portable.parameters).max() < 2e-3


def test_patience_stops_and_keeps_the_best(tmp_path):
    data = dataset(iiwa_power, count=8, rows=120)
    early = small(data, tmp_path, 2000, patience=5)
    assert early.run.epoch < 2000
    assert early.run.best_loss == min(loss for _, _, loss in early.run.history)
