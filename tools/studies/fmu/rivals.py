"""FMUs of the same network by onnx2fmu and by pythonfmu, as far as these tools allow.

Both get the network in its shortest form, in which the features are one affine map of the window of rows and the head
is folded. The state of the network (window, hidden and cell state) is kept in onnx2fmu's "local" variables, as its
manual describes.

onnx2fmu downloads ONNX Runtime from GitHub into /tmp/onnxruntime when it builds, unless it is already there.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.models.networks.architecture import HIDDEN
from acqd.models.networks.predictor import NetworkPredictor

Floats = NDArray[np.float64]

_SLAVE = '''"""An LSTM behind an affine map of a window of rows."""
from pathlib import Path

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Network(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.n = dict(np.load(Path(__file__).parent / "network.npz"))
        self.axes = int(self.n["axes"])
        for k in range(self.axes):
            setattr(self, f"q{k + 1}", 0.0)
            self.register_variable(Real(f"q{k + 1}", causality=Fmi2Causality.input))
        self.power = 0.0
        self.register_variable(Real("power", causality=Fmi2Causality.output))
        self.names = [f"q{k + 1}" for k in range(self.axes)]
        self.window = np.zeros(self.n["A"].shape[1])
        self.hidden = np.zeros(10)
        self.cell = np.zeros(10)

    def do_step(self, current_time, step_size):
        n = self.n
        window = self.window
        window[: -self.axes] = window[self.axes :]
        for k, name in enumerate(self.names):
            window[k - self.axes] = getattr(self, name)
        gates = n["W"] @ (n["A"] @ window + n["a"]) + n["R"] @ self.hidden + n["b"]
        soft = 0.5 + 0.5 * np.tanh(0.5 * gates)
        self.cell = soft[10:20] * self.cell + soft[:10] * np.tanh(gates[20:30])
        self.hidden = soft[30:] * np.tanh(self.cell)
        self.power = float(n["out"] @ self.hidden + n["bias"])
        return True
'''


@dataclass(frozen=True, slots=True)
class FoldedNetwork:
    """Features A window + a, LSTM with W, R and b, power out hidden + bias in W."""

    axes: int
    A: Floats
    """[width, window x axes]."""
    a: Floats
    """[width]."""
    W: Floats
    """[4 hidden, width], gates in the order i, f, g, o."""
    R: Floats
    """[4 hidden, hidden]."""
    b: Floats
    """[4 hidden]."""
    out: Floats
    """[hidden] W."""
    bias: float
    """W."""

    @classmethod
    def of(cls, model: NetworkPredictor) -> FoldedNetwork:
        """Determine the affine features from the unit vectors of the window."""
        rows = 2 * model.radius + 1
        a = model._features(np.zeros((rows, model.axes)))[0]
        units = np.eye(rows * model.axes).reshape(-1, rows, model.axes)
        A = np.column_stack([model._features(unit)[0] - a for unit in units])
        weight, bias = model.head()
        scale, offset = model.normal.P_scale, model.normal.P_offset
        return cls(
            model.axes, A, a, model._W, model._R, model._b, weight * scale, bias * scale + offset
        )  # fmt: skip


def with_pythonfmu(network: FoldedNetwork, folder: Path) -> Path:
    """Build an FMU of FMI 2.0 with pythonfmu. Raises RuntimeError."""
    folder.mkdir(parents=True)
    (folder / "network_slave.py").write_text(_SLAVE)
    arrays: dict[str, Any] = {name: getattr(network, name) for name in ("axes", "A", "a", "W", "R", "b", "out", "bias")}
    np.savez(folder / "network.npz", **arrays)
    _run(
        [sys.executable, "-m", "pythonfmu", "build", "-f", str(folder / "network_slave.py"), "-d", str(folder),
         str(folder / "network.npz")]
    )  # fmt: skip
    return folder / "Network.fmu"


def with_onnx2fmu(network: FoldedNetwork, folder: Path) -> Path:
    """Build an FMU of FMI 2.0 with onnx2fmu. Raises RuntimeError."""
    folder.mkdir(parents=True)
    (folder / "network.onnx").write_bytes(onnx_bytes(network))
    state = [("past", "past_next"), ("hidden", "hidden_next"), ("cell", "cell_next")]
    description = {
        "name": "Network", "description": "LSTM", "FMIVersion": "2.0",
        "inputs": [{"name": "q", "start": "0.0"}], "outputs": [{"name": "power"}],
        "locals": [{"nameIn": old, "nameOut": new, "start": "0.0"} for old, new in state],
    }  # fmt: skip
    (folder / "network.json").write_text(json.dumps(description))
    _run(
        [sys.executable, "-m", "onnx2fmu.app", "build", str(folder / "network.onnx"), str(folder / "network.json"),
         str(folder / "target"), "--destination", str(folder)]
    )  # fmt: skip
    return folder / "Network.fmu"


def onnx_bytes(network: FoldedNetwork) -> bytes:
    """ONNX model of one step in single precision, from angles and state to power and next state."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    window = network.A.shape[1]
    past = window // network.axes - 1
    gates = np.r_[0:HIDDEN, 3 * HIDDEN : 4 * HIDDEN, HIDDEN : 3 * HIDDEN]  # ONNX orders them i, o, f, c
    constants = {
        "A": network.A.T, "a": network.a, "W": network.W[gates][None], "R": network.R[gates][None],
        "b": np.concatenate([network.b[gates], np.zeros(4 * HIDDEN)])[None],
        "out": network.out[:, None], "bias": np.array([network.bias]),
    }  # fmt: skip
    integers = {
        "flat": [1, window], "third": [1, 1, len(network.a)], "state": [1, 1, HIDDEN], "row": [1, HIDDEN],
        "one": [1], "end": [past + 1], "first": [0], "scalar": [1],
    }  # fmt: skip
    nodes = [
        helper.make_node("Concat", ["past", "q"], ["window"], axis=0),
        helper.make_node("Slice", ["window", "one", "end", "first"], ["past_next"]),
        helper.make_node("Reshape", ["window", "flat"], ["flattened"]),
        helper.make_node("Gemm", ["flattened", "A", "a"], ["x"]),
        helper.make_node("Reshape", ["x", "third"], ["X"]),
        helper.make_node("Reshape", ["hidden", "state"], ["h"]),
        helper.make_node("Reshape", ["cell", "state"], ["c"]),
        helper.make_node("LSTM", ["X", "W", "R", "b", "", "h", "c"], ["", "h_next", "c_next"], hidden_size=HIDDEN),
        helper.make_node("Reshape", ["h_next", "row"], ["hidden_next"]),
        helper.make_node("Reshape", ["c_next", "row"], ["cell_next"]),
        helper.make_node("Gemm", ["hidden_next", "out", "bias"], ["P"]),
        helper.make_node("Reshape", ["P", "scalar"], ["power"]),
    ]
    shapes = {"q": [1, network.axes], "past": [past, network.axes], "hidden": [1, HIDDEN], "cell": [1, HIDDEN]}
    inputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in shapes.items()]
    outputs = [helper.make_tensor_value_info("power", TensorProto.FLOAT, [1])] + [
        helper.make_tensor_value_info(f"{name}_next", TensorProto.FLOAT, shapes[name])
        for name in ("past", "hidden", "cell")
    ]
    initial = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()]
    initial += [numpy_helper.from_array(np.array(value, dtype=np.int64), name) for name, value in integers.items()]
    graph = helper.make_graph(nodes, "network", inputs, outputs, initial)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 14)], ir_version=8)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        message = next((line for line in lines if "rror" in line), lines[-1] if lines else "no error message")
        raise RuntimeError(message.strip()[:160])


RIVALS = {"onnx2fmu": with_onnx2fmu, "pythonfmu": with_pythonfmu}
