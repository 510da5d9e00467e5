"""The array type of the package."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
"""Double-precision array; the shape and the unit are in the docstring where one is used."""
Singles: TypeAlias = NDArray[np.float32]
"""Single-precision array, where many of them wait in memory; calculations with them are in double precision."""
