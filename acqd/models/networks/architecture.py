"""The eight structures of the thesis' appendix B, for any number of axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from acqd.errors import UserError

HIDDEN = 10
HEAD = (8, 6, 5, 1)
"""Fully connected layers without activations: together one affine map."""
Inputs = Literal["q", "q,qd", "q,qd,qdd", "frames"]


@dataclass(frozen=True, slots=True)
class Architecture:
    """Inputs of the LSTM. The LSTM(10) and the head behind it are the same in all eight."""

    name: str
    inputs: Inputs
    kernels: int = 0
    """Convolution kernels, shared by all axes."""
    length: int = 1
    """Rows that a kernel sees."""
    betas: tuple[float, float] = (0.9, 0.999)
    """Adam's decay factors (Table 7.3)."""

    @property
    def radius(self) -> int:
        """Rows before and after a row that its features need."""
        return {"q": 0, "q,qd": 1, "q,qd,qdd": 1, "frames": self.length // 2}[self.inputs]

    def width(self, axes: int) -> int:
        """Number of inputs of the LSTM."""
        return axes * (self.kernels or self.inputs.count(",") + 1)

    def shapes(self, axes: int) -> dict[str, tuple[int, ...]]:
        """Shapes of the learnable arrays, in the order of the flat vector.

        Gates are in the order i, f, g, o, with one bias per gate as in MATLAB.
        """
        shapes: dict[str, tuple[int, ...]] = {}
        if self.kernels:
            shapes |= {"kernel": (self.kernels, self.length), "kernel_bias": (self.kernels,)}
        shapes |= {"W": (4 * HIDDEN, self.width(axes)), "R": (4 * HIDDEN, HIDDEN), "b": (4 * HIDDEN,)}
        before = HIDDEN
        for number, size in enumerate(HEAD):
            shapes |= {f"fc{number}": (size, before), f"fc{number}_bias": (size,)}
            before = size
        return shapes

    def learnables(self, axes: int) -> int:
        """Number of learnable parameters."""
        total = 0
        for shape in self.shapes(axes).values():
            size = 1
            for extent in shape:
                size *= extent
            total += size
        return total


ARCHITECTURES = {
    structure.name: structure
    for structure in (
        Architecture("7x1dim", "q", betas=(0.99, 0.9)),
        Architecture("14x1dim", "q,qd"),
        Architecture("21x1dim", "q,qd,qdd"),
        Architecture("2conv1x3", "frames", 2, 3),
        Architecture("3conv1x3", "frames", 3, 3),
        Architecture("3conv1x5", "frames", 3, 5),
        Architecture("3conv1x11", "frames", 3, 11),
        Architecture("5conv1x21", "frames", 5, 21),
    )
}


def architecture(name: str) -> Architecture:
    """The structure of that name. Raises UserError."""
    if name not in ARCHITECTURES:
        raise UserError(f"no network {name!r}; the networks are {', '.join(ARCHITECTURES)}")
    return ARCHITECTURES[name]
