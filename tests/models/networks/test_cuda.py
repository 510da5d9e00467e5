"""The torch engine on a CUDA device against the same engine on a CPU. Skipped where no device is."""

import numpy as np
import pytest

from acqd.models.networks.architecture import ARCHITECTURES, architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.flat_parameters import initial

pytestmark = pytest.mark.xdist_group("torch")


@pytest.mark.parametrize("name", list(ARCHITECTURES))
def test_a_gradient_on_a_gpu_is_that_of_the_cpu(name):
    import torch  # here: one worker imports torch, for seconds

    from acqd.models.networks.torch_engine import TorchEngine

    if not torch.cuda.is_available():
        pytest.skip("no CUDA device")
    chosen, axes, rows = architecture(name), 6, 33
    random = np.random.default_rng(6)
    theta = initial(chosen, axes, 1) + 0.1 * random.standard_normal(chosen.learnables(axes)).astype(np.float32)
    margin = 2 * chosen.radius if chosen.kernels else 0
    width = axes if chosen.kernels else chosen.width(axes)
    batch = Batch(
        random.standard_normal((19, rows + margin, width)).astype(np.float32),
        random.standard_normal((19, rows)).astype(np.float32),
    )
    computed = [TorchEngine(chosen, axes, device) for device in ("cpu", "cuda")]
    (loss, gradient), (on_gpu, gradient_on_gpu) = (each.gradient(theta, each.prepare(batch)) for each in computed)
    assert on_gpu == pytest.approx(loss, rel=1e-5)
    assert np.abs(gradient_on_gpu - gradient).max() < 2e-5 * np.abs(gradient).max()
