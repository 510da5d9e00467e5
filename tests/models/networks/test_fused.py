"""The fused engine against autograd."""

import numpy as np
import pytest

from acqd.instruction_sets import INSTRUCTION_SETS, best_instruction_set
from acqd.models.networks.architecture import ARCHITECTURES, architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.flat_parameters import initial
from acqd.models.networks.fused.engine import FusedEngine

pytestmark = pytest.mark.xdist_group("torch")


def autograd(chosen, axes):
    from acqd.models.networks.torch_engine import TorchEngine  # here: one worker imports torch, for seconds

    return TorchEngine(chosen, axes)


def usable(instructions):
    return instructions.lanes <= best_instruction_set().lanes


@pytest.mark.parametrize("name", list(ARCHITECTURES))
@pytest.mark.parametrize("instructions", INSTRUCTION_SETS, ids=lambda each: each.name)
def test_fused_gradients_are_those_of_autograd(name, instructions):
    if not usable(instructions):
        pytest.skip("this processor lacks them")
    chosen = architecture(name)
    for axes, count, rows in ((7, 11, 90), (6, 19, 33), (3, 1, 1)):
        random = np.random.default_rng(axes)
        theta = initial(chosen, axes, 1) + 0.1 * random.standard_normal(chosen.learnables(axes)).astype(np.float32)
        margin = 2 * chosen.radius if chosen.kernels else 0
        width = axes if chosen.kernels else chosen.width(axes)
        batch = Batch(
            random.standard_normal((count, rows + margin, width)).astype(np.float32),
            random.standard_normal((count, rows)).astype(np.float32),
        )
        reference, fused = autograd(chosen, axes), FusedEngine(chosen, axes, instructions)
        prepared = reference.prepare(batch)
        loss, gradient = reference.gradient(theta, prepared)
        own_loss, own = fused.gradient(theta, fused.prepare(batch))
        assert own_loss == pytest.approx(loss, rel=1e-5)
        assert fused.loss(theta, fused.prepare(batch)) == pytest.approx(reference.loss(theta, prepared), rel=1e-5)
        assert np.abs(own - gradient).max() < 1e-5 * np.abs(gradient).max()


def test_saturated_gates_do_not_break_the_fused_path():
    chosen = architecture("21x1dim")
    theta = initial(chosen, 7, 1) * 200
    batch = Batch(np.ones((2, 20, 21), dtype=np.float32), np.zeros((2, 20), dtype=np.float32))
    reference, fused = autograd(chosen, 7), FusedEngine(chosen, 7)
    loss, gradient = fused.gradient(theta, fused.prepare(batch))
    assert np.isfinite(loss) and np.isfinite(gradient).all()
    assert loss == pytest.approx(reference.loss(theta, reference.prepare(batch)), rel=1e-4)
