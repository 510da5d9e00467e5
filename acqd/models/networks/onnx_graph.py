"""A network as an ONNX graph in double precision, from joint angles [T, axes] rad to power [T] W.

The LSTM is a Scan over rows: onnxruntime computes the operator LSTM in single precision only, which would differ from
the bundle by more than 1e-6.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from acqd.models.networks.architecture import HIDDEN
from acqd.models.networks.predictor import NetworkPredictor

OPSET, IR_VERSION = 18, 9  # of onnxruntime 1.17 and later
PRODUCER = "acqd"
_DOUBLE = TensorProto.DOUBLE


class _Graph:
    """Nodes and constants of a graph under construction. Every operation returns the name of its result.

    Names begin with `prefix`: those of a body must differ from those of the graph around it.
    """

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, values: Any, kind: type = np.float64) -> str:
        """A constant tensor."""
        name = f"{self._prefix}constant{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(values, dtype=kind), name))
        return name

    def op(self, kind: str, *inputs: str, **attributes: Any) -> str:
        """A node with one result."""
        name = f"{self._prefix}{kind.lower()}{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def rows(self, tensor: str, first: int, last: int) -> str:
        """Rows [first:last]; `last` 0 is the end."""
        bounds = (self.constant([bound], np.int64) for bound in (first, last or np.iinfo(np.int64).max, 0))
        return self.op("Slice", tensor, *bounds)

    def affine(self, x: str, weights: Any, bias: Any) -> str:
        """x @ weights + bias."""
        return self.op("Add", self.op("MatMul", x, self.constant(weights)), self.constant(bias))


def onnx_model(model: NetworkPredictor, metadata: dict[str, str]) -> onnx.ModelProto:
    """The network as a model with the input `q` and the output `P`; `metadata` becomes its properties."""
    graph = _Graph()
    features = _features(graph, model)
    W, R, b = (model.arrays[name].astype(np.float64) for name in ("W", "R", "b"))
    driven = graph.affine(features, W.T, b)
    zero = graph.constant(np.zeros(HIDDEN))
    graph.nodes.append(
        helper.make_node(
            "Scan", [zero, zero, driven], ["h_last", "c_last", "hidden"], body=_lstm_row(R), num_scan_inputs=1
        )
    )
    weight, bias = model.head()
    scale, offset = model.normal.P_scale, model.normal.P_offset
    power = graph.affine("hidden", weight[:, None] * scale, bias * scale + offset)
    graph.nodes.append(helper.make_node("Squeeze", [power, graph.constant([1], np.int64)], ["P"]))
    inputs = [helper.make_tensor_value_info("q", _DOUBLE, ["T", model.axes])]
    outputs = [helper.make_tensor_value_info("P", _DOUBLE, ["T"])]
    inputs[0].doc_string, outputs[0].doc_string = f"joint angles, rad, {model.step_s} s apart", "mains power, W"
    whole = helper.make_graph(graph.nodes, "acqd", inputs, outputs, graph.constants)
    made = helper.make_model(
        whole, producer_name=PRODUCER, ir_version=IR_VERSION, opset_imports=[helper.make_opsetid("", OPSET)]
    )
    helper.set_model_props(made, metadata)
    onnx.checker.check_model(made, full_check=True)
    return made


def _features(graph: _Graph, model: NetworkPredictor) -> str:
    """Inputs of the LSTM [T, width]: see `predictor.network_inputs`."""
    architecture, normal = model.architecture, model.normal
    padded = _padded(graph, model.radius)

    def normalised(order: int, values: str) -> str:
        centred = graph.op("Sub", values, graph.constant(normal.offset[order]))
        return graph.op("Div", centred, graph.constant(normal.scale[order]))

    if architecture.kernels:
        return _convolved(graph, normalised(0, padded), model)
    if architecture.inputs == "q":
        return normalised(0, padded)
    before, here, after = graph.rows(padded, 0, -2), graph.rows(padded, 1, -1), graph.rows(padded, 2, 0)
    qd = graph.op("Div", graph.op("Sub", after, before), graph.constant(2 * model.step_s))
    twice = graph.op("Mul", here, graph.constant(2.0))
    bend = graph.op("Add", graph.op("Sub", after, twice), before)
    qdd = graph.op("Div", bend, graph.constant(model.step_s**2))
    orders = [normalised(0, here), normalised(1, qd), normalised(2, qdd)]
    return graph.op("Concat", *orders[: architecture.inputs.count(",") + 1], axis=1)


def _padded(graph: _Graph, radius: int) -> str:
    """The angles with both ends repeated `radius` times, by gathering rows at clipped indices."""
    if not radius:
        return "q"
    length = graph.op("Squeeze", graph.op("Shape", "q", start=0, end=1))
    end = graph.op("Add", length, graph.constant(radius, np.int64))
    index = graph.op("Range", graph.constant(-radius, np.int64), end, graph.constant(1, np.int64))
    last = graph.op("Sub", length, graph.constant(1, np.int64))
    return graph.op("Gather", "q", graph.op("Clip", index, graph.constant(0, np.int64), last), axis=0)


def _convolved(graph: _Graph, values: str, model: NetworkPredictor) -> str:
    """Maps of the kernels [T, kernels * axes] of values [T + 2 radius, axes]."""
    length = graph.op("Squeeze", graph.op("Shape", "q", start=0, end=1))
    rows = graph.op("Range", graph.constant(0, np.int64), length, graph.constant(1, np.int64))
    column = graph.op("Unsqueeze", rows, graph.constant([1], np.int64))
    index = graph.op("Add", column, graph.constant(np.arange(model.architecture.length), np.int64))
    frames = graph.op("Gather", values, index, axis=0)  # [T, length, axes]
    kernel = graph.constant(model.arrays["kernel"].astype(np.float64))
    bias = graph.constant(model.arrays["kernel_bias"].astype(np.float64)[:, None])
    maps = graph.op("Add", graph.op("MatMul", kernel, frames), bias)
    return graph.op("Reshape", maps, graph.constant([0, -1], np.int64))


def _lstm_row(R: np.ndarray) -> Any:
    """The body of the Scan: (hidden, cell, driven row) to (hidden, cell, hidden); gates in the order i, f, g, o."""
    graph = _Graph("row_")
    gates = graph.op("Add", "driven_row", graph.op("MatMul", graph.constant(R), "h"))
    sizes = graph.constant([HIDDEN] * 4, np.int64)
    graph.nodes.append(helper.make_node("Split", [gates, sizes], ["i", "f", "g", "o"], axis=0))
    kept = graph.op("Mul", graph.op("Sigmoid", "f"), "c")
    new = graph.op("Mul", graph.op("Sigmoid", "i"), graph.op("Tanh", "g"))
    graph.nodes.append(helper.make_node("Add", [kept, new], ["c_next"]))
    out = graph.op("Tanh", "c_next")
    graph.nodes.append(helper.make_node("Mul", [graph.op("Sigmoid", "o"), out], ["h_next"]))
    graph.nodes.append(helper.make_node("Identity", ["h_next"], ["row"]))
    row = {name: helper.make_tensor_value_info(name, _DOUBLE, [HIDDEN]) for name in ("h", "c")}
    row["driven_row"] = helper.make_tensor_value_info("driven_row", _DOUBLE, [4 * HIDDEN])
    results = [helper.make_tensor_value_info(name, _DOUBLE, [HIDDEN]) for name in ("h_next", "c_next", "row")]
    return helper.make_graph(graph.nodes, "lstm_row", list(row.values()), results, graph.constants)
