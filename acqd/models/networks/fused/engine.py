"""The fused C function as an engine."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from acqd.instruction_sets import InstructionSet, best_instruction_set
from acqd.models.networks.architecture import HIDDEN, Architecture
from acqd.models.networks.batches import Batch
from acqd.models.networks.engine import Engine
from acqd.models.networks.flat_parameters import Float32s, Head, views
from acqd.models.networks.fused.compiled import library

_HEAD = HIDDEN + 1


class _Shape(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int) for name in ("steps", "groups", "axes", "kernels", "length", "width")]


@dataclass(frozen=True, slots=True)
class _Prepared:
    shape: _Shape
    inputs: Float32s
    target: Float32s
    weight: Float32s
    samples: int


class FusedEngine(Engine):
    """Computes several sequences at once, one per vector lane. Raises OperationError without a compiler."""

    def __init__(self, architecture: Architecture, axes: int, instructions: InstructionSet | None = None) -> None:
        super().__init__(architecture, axes)
        chosen = instructions or best_instruction_set()
        self.name = f"fused {chosen.name}"
        self._library = library(chosen)
        self._lanes = chosen.lanes
        self._scratch = _aligned(0)
        layers = sum(size for name, size in self._sizes() if name.startswith("fc"))
        self._body = architecture.learnables(axes) - layers

    def _sizes(self) -> list[tuple[str, int]]:
        return [(name, int(np.prod(shape))) for name, shape in self.architecture.shapes(self.axes).items()]

    def prepare(self, batch: Batch) -> _Prepared:
        """Inputs as [groups, T, columns, lanes]: the lanes of a vector are neighbours in memory."""
        count, rows = batch.target.shape
        groups = -(-count // self._lanes)
        inputs = np.zeros((groups * self._lanes, *batch.inputs.shape[1:]), dtype=np.float32)
        target = np.zeros((groups * self._lanes, rows), dtype=np.float32)
        inputs[:count], target[:count] = batch.inputs, batch.target
        weight = (np.arange(groups * self._lanes) < count).astype(np.float32)
        width = self.architecture.width(self.axes)
        shape = _Shape(rows, groups, self.axes, self.architecture.kernels, self.architecture.length, width)
        by_group = inputs.reshape(groups, self._lanes, *inputs.shape[1:])
        return _Prepared(
            shape,
            _copied(by_group.transpose(0, 2, 3, 1)),
            _copied(target.reshape(groups, self._lanes, rows).transpose(0, 2, 1)),
            _copied(weight),
            count * rows,
        )

    def gradient(self, parameters: Float32s, prepared: _Prepared) -> tuple[float, Float32s]:
        """The C function gives the gradient of the folded head, which is unfolded onto the four layers."""
        head = Head.fold(views(self.architecture, self.axes, parameters))
        folded = np.zeros(self._body + _HEAD, dtype=np.float32)
        total = self._call(self._packed(parameters, head), prepared, folded)
        folded /= prepared.samples
        gradient = np.empty_like(parameters)
        gradient[: self._body] = folded[: self._body]
        head.unfold(folded[self._body : -1], float(folded[-1]), views(self.architecture, self.axes, gradient))
        return total / prepared.samples, gradient

    def loss(self, parameters: Float32s, prepared: _Prepared) -> float:
        """Forward pass only."""
        head = Head.fold(views(self.architecture, self.axes, parameters))
        return self._call(self._packed(parameters, head), prepared, None) / prepared.samples

    def _packed(self, parameters: Float32s, head: Head) -> Float32s:
        return np.concatenate([parameters[: self._body], head.weight, [head.bias]], dtype=np.float32)

    def _call(self, packed: Float32s, prepared: _Prepared, gradient: Float32s | None) -> float:
        needed = self._library.acqd_scratch(ctypes.byref(prepared.shape)) * self._lanes
        if len(self._scratch) < needed:
            self._scratch = _aligned(needed)
        total: float = self._library.acqd_lstm(
            ctypes.byref(prepared.shape),
            _address(packed),
            _address(prepared.inputs),
            _address(prepared.target),
            _address(prepared.weight),
            _address(self._scratch),
            None if gradient is None else _address(gradient),
            None,
        )
        return total


def _address(array: Float32s) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _aligned(count: int) -> Float32s:
    """[count] zeros on a 64-byte boundary, as AVX-512 loads require."""
    raw = np.zeros(4 * count + 64, dtype=np.uint8)
    first = -raw.ctypes.data % 64
    return raw[first : first + 4 * count].view(np.float32)


def _copied(array: Float32s) -> Float32s:
    flat = _aligned(array.size)
    flat[:] = np.ascontiguousarray(array, dtype=np.float32).ravel()
    return flat
