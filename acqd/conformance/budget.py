"""Uncertainty budgets of a described box, by the GUM (JCGM 100:2008): limits of error become standard uncertainties.

A limit of error without more knowledge is a rectangular distribution: its half width over the square root of three.
Components are independent; the expanded uncertainty has the coverage factor k = 2. The method is a component, too: the
largest error of the simulated points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from acqd.conformance.limits import ENERGY_05S, FREQUENCY, MAGNITUDE, energy
from acqd.conformance.point import Limit, Point
from acqd.conformance.terminal import Terminal, TransformerClass, Uncertainty

COVERAGE = 2.0
_RATIO: dict[TransformerClass, float] = {"0.1": 0.1, "0.2": 0.2, "0.2S": 0.2, "0.5": 0.5, "0.5S": 0.5, "1": 1.0}
"""% of the ratio at the rated current (IEC 61869-2) and at 80 to 120 % of the rated voltage (IEC 61869-3)."""
_CT_MINUTES: dict[TransformerClass, float] = {"0.1": 5, "0.2": 10, "0.2S": 10, "0.5": 30, "0.5S": 30, "1": 60}
_VT_MINUTES = {"0.1": 5.0, "0.2": 10.0, "0.5": 20.0, "1": 40.0}
"""Minutes of arc of the phase displacement, at the same conditions."""
_MINUTE = math.pi / 180 / 60


@dataclass(frozen=True, slots=True)
class Component:
    """One line of a budget."""

    name: str
    half_width: float
    """Limit of error, in the unit of the component."""
    unit: str
    sensitivity: float
    """Unit of the quantity per unit of the component."""

    @property
    def contribution(self) -> float:
        """Standard uncertainty of the quantity from this component."""
        return abs(self.sensitivity) * self.half_width / math.sqrt(3)


@dataclass(frozen=True, slots=True)
class Budget:
    """Of one quantity at one operating point."""

    quantity: str
    unit: str
    components: list[Component]
    limit: Limit | None

    @property
    def combined(self) -> float:
        """Combined standard uncertainty."""
        return math.sqrt(sum(one.contribution**2 for one in self.components))

    @property
    def expanded(self) -> float:
        """Expanded uncertainty, k = 2."""
        return COVERAGE * self.combined

    @property
    def passed(self) -> bool | None:
        """Whether the expanded uncertainty is within the limit; None without one."""
        return None if self.limit is None else self.expanded <= self.limit.value

    def as_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "quantity": self.quantity, "unit": self.unit, "combined": self.combined, "expanded": self.expanded,
            "k": COVERAGE, "limit": self.limit.value if self.limit else None, "passed": self.passed,
            "components": [
                {"name": one.name, "half_width": one.half_width, "unit": one.unit, "sensitivity": one.sensitivity,
                 "contribution": one.contribution}
                for one in self.components
            ],
        }  # fmt: skip


def budgets(terminal: Terminal, points: Sequence[Point]) -> list[Budget]:
    """The budgets of a terminal; none where neither converter nor transformers are described."""
    if not terminal.described:
        return []
    declared, In = terminal.declared_voltage, terminal.nominal_current
    U, I = list(_voltage(terminal)), list(_current(terminal))  # noqa: E741
    made = [
        Budget(f"Vrms at {declared:g} V", "% of Udin", [*U, _method(points, "magnitude")], MAGNITUDE),
        Budget(f"Irms at {In:g} A", "%", I, None),
    ]
    for factor in (1.0, 0.5):
        phase = list(_phase(terminal, factor))
        allowed = next(limit for share, pf, limit in ENERGY_05S if (share, pf) == (1.0, factor))
        made.append(
            Budget(
                f"P and energy at {declared:g} V, {In:g} A, power factor {factor:g}", "%",
                [*U, *I, *phase, _method(points, "energy, balanced load")], energy(allowed, household=False),
            )
        )  # fmt: skip
    clock = (terminal.uncertainty or Uncertainty()).clock_ppm
    mhz = terminal.f_nominal * 1e-3
    made.append(
        Budget(
            f"f at {terminal.f_nominal} Hz", "mHz",
            [Component("sampling clock", clock, "ppm", mhz), _method(points, "power frequency")], FREQUENCY,
        )
    )  # fmt: skip
    return made


def _voltage(terminal: Terminal) -> Iterator[Component]:
    yield from _converter(terminal, "voltage", terminal.range_v, terminal.declared_voltage)
    if (named := terminal.transformers.voltage) is not None:
        yield Component(f"voltage transformer class {named}: ratio", _RATIO[named], "%", 1.0)


def _current(terminal: Terminal) -> Iterator[Component]:
    yield from _converter(terminal, "current", terminal.range_a, terminal.nominal_current)
    if (named := terminal.transformers.current) is not None:
        yield Component(f"current transformer class {named}: ratio", _RATIO[named], "%", 1.0)


def _converter(terminal: Terminal, channel: str, full: float, reading: float) -> Iterator[Component]:
    """Errors of one channel in % of the reading (RMS)."""
    if (limits := terminal.uncertainty) is not None:
        yield Component(f"converter, {channel}: gain", limits.gain_percent, "% of reading", 1.0)
        drift = limits.temperature_ppm_per_k * limits.temperature_range_k
        yield Component(f"converter, {channel}: temperature", drift, "ppm", 1e-4)
        # A direct component o adds o^2 to the mean square: o / 2 R relative, per unit of o / R.
        share = limits.offset_percent / 100 * full / reading
        yield Component(
            f"converter, {channel}: offset", limits.offset_percent, "% of range", share * full / reading / 2
        )
    step = 2 * full / 2**terminal.bits
    spread = step * math.hypot(terminal.noise_digits, 1 / math.sqrt(12))
    samples = terminal.window * terminal.rate
    random = 100 * spread / reading / math.sqrt(samples)
    yield Component(f"converter, {channel}: noise and steps over a window", math.sqrt(3) * random, "% of reading", 1.0)


def _phase(terminal: Terminal, factor: float) -> Iterator[Component]:
    """Angles between voltage and current: P changes by tan(phi) per rad."""
    slope = 100 * math.tan(math.acos(factor))
    if terminal.uncertainty is not None:
        turn = 2 * math.pi * terminal.f_nominal * 1e-6
        yield Component("delay between voltage and current", terminal.uncertainty.delay_us, "us", slope * turn)
    if (named := terminal.transformers.voltage) is not None:
        yield Component(f"voltage transformer class {named}: displacement", _VT_MINUTES[named], "min", slope * _MINUTE)
    if (other := terminal.transformers.current) is not None:
        yield Component(f"current transformer class {other}: displacement", _CT_MINUTES[other], "min", slope * _MINUTE)


def _method(points: Sequence[Point], parameter: str) -> Component:
    errors = [one.error for one in points if one.parameter == parameter and math.isfinite(one.error) and one.passed]
    worst = max(errors, default=0.0)
    named = "method: largest error of the simulated points" if errors else "method: no point of it was simulated"
    return Component(named, worst, "unit of the quantity", 1.0)
