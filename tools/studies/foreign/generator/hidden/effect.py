"""A hidden effect, per unit of its size, and how large it is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from tools.studies.foreign.generator.arm import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Hidden:
    """An effect at its place. The hooks that are None do nothing."""

    id: str
    """acqd's name for the effect, or the name of an effect outside of the library."""
    place: str
    """As acqd's reports name places."""
    unit: str = ""
    """Unit of the true parameter."""
    start: float = 1.0
    """A size of the usual magnitude, from which the search for a strength starts."""
    most: float = 1e6
    """Largest size."""
    everywhere: bool = False
    """The strength counts all rows: the RMS over the few rows that a ceiling clips does not grow with the clipping."""
    details: dict[str, float] = field(default_factory=dict)
    """Shape parameters."""
    truth: Callable[[float], float] | None = None
    """The parameter that acqd should report for a size; None where nothing is comparable."""
    torque: Floats | None = None
    """[T, n] Nm per unit size."""
    behind_gear: bool = False
    """Sensors behind the gears see the torque: bodies, forces and springs, not friction."""
    drives: Callable[[Floats, Floats, float], Floats] | None = None
    """(motor torque [T, n] Nm, drives [T] W, size) to additional W [T] at the DC link."""
    load: Callable[[Floats, Floats, float], Floats] | None = None
    """(drives [T] W, mains [T] W, size) to additional W [T] at the mains."""
    late: Callable[[float], Floats | float] | None = None
    """Size to s by which the metered power is later than the motion."""
    meter: Callable[[Floats, Floats, float], Floats] | None = None
    """(power [W] W, voltage [W] V, size) to what the meter shows [W] W."""


@dataclass(frozen=True, slots=True)
class Dose:
    """An effect with its size."""

    effect: Hidden
    size: float

    @property
    def truth(self) -> float | None:
        """The true parameter in `effect.unit`."""
        return None if self.effect.truth is None else self.effect.truth(self.size)
