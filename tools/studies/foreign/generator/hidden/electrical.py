"""Losses, loads of the cabinet, faults of the meter and of clocks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tools.studies.foreign.generator.arm import Floats
from tools.studies.foreign.generator.hidden.effect import Hidden
from tools.studies.foreign.generator.hidden.switching import bursts, rhythm

if TYPE_CHECKING:
    from tools.studies.foreign.generator.plant import Session

_NOMINAL_V = 230.0


def copper_loss(session: Session, random: np.random.Generator) -> Hidden:
    """A winding of one joint loses more."""
    joint = int(random.choice([1, 3] if session.plant.arm.joints > 6 else [1, 2]))
    link_W = session.plant.supply.control_W + 60.0
    slope = session.plant.supply.marginal(link_W)
    return Hidden(
        id="copper_loss", place=f"joint {joint + 1}", unit="W/Nm^2", start=0.02,
        drives=lambda motor, _, size: size * motor[:, joint] ** 2, truth=lambda size: size * slope,
    )  # fmt: skip


def supply_efficiency(session: Session, random: np.random.Generator) -> Hidden:
    """The rectifier loses more, with the square of its load."""
    control = session.plant.supply.control_W

    def load(drives: Floats, _: Floats, size: float) -> Floats:
        return session.plant.supply.lagged(size * (np.maximum(drives + control, 0.0) / 100) ** 2)

    return Hidden(id="supply_efficiency", place="supply", unit="W", start=5.0, load=load)


def regeneration_clipping(session: Session, random: np.random.Generator) -> Hidden:
    """A chopper burns what the drives give back beyond a threshold."""
    above = float(random.uniform(0, 5))

    def burnt(_: Floats, drives: Floats, size: float) -> Floats:
        return np.asarray(size * np.maximum(-drives - above, 0.0))

    return Hidden(
        id="regeneration_clipping", place="DC link", unit="-", start=0.5, most=1.5, drives=burnt,
        details={"above_W": above},
    )  # fmt: skip


def offset_shift(session: Session, random: np.random.Generator) -> Hidden:
    """Another device on the same meter."""
    sign = float(random.choice([-1, 1]))
    return Hidden(
        id="offset_shift", place="cabinet", unit="W", start=10.0, truth=lambda size: sign * size,
        load=lambda drives, mains, size: np.full_like(mains, sign * size),
    )  # fmt: skip


def brake_holding(session: Session, random: np.random.Generator) -> Hidden:
    """The coils of the open brakes take more."""
    return _signal(session.brake, "brake_holding", "brakes")


def tool_actuation(session: Session, random: np.random.Generator) -> Hidden:
    """The tool takes power while it is on."""
    return _signal(session.tool, "tool_actuation", "tool")


def brake_release(session: Session, random: np.random.Generator) -> Hidden:
    """A peak after the brakes open that decays."""
    t, decay = session.motion.t, float(random.uniform(0.08, 0.2))
    opened = np.flatnonzero(np.diff(session.brake) > 0) + 1
    peak = np.zeros(len(t))
    for first in opened:
        age = t[first : first + 200] - t[first]
        peak[first : first + 200] += np.exp(-age / decay)
    return Hidden(
        id="brake_release", place="brakes", start=50.0, details={"decay_s": decay},
        load=lambda drives, mains, size: size * peak,
    )  # fmt: skip


def process_load(session: Session, random: np.random.Generator) -> Hidden:
    """Equipment that works for some seconds at irregular times."""
    on = bursts(session.motion.t, random, on_s=(3, 15), off_s=(8, 60))
    return _cabinet(on, "process_load", {})


def thermostat(session: Session, random: np.random.Generator) -> Hidden:
    """A heater with a rhythm."""
    period, duty = float(random.uniform(25, 90)), float(random.uniform(0.3, 0.65))
    on = rhythm(session.motion.t, random, period, duty)
    return _cabinet(on, "thermostat", {"period_s": period, "duty": duty})


def line_voltage(session: Session, random: np.random.Generator) -> Hidden:
    """All power follows the mains voltage."""
    return Hidden(
        id="line_voltage", place="all loads", unit="-", start=1.5, most=5.0, truth=lambda size: size,
        meter=lambda power, volts, size: power * (volts / _NOMINAL_V) ** size,
    )  # fmt: skip


def meter_gain(session: Session, random: np.random.Generator) -> Hidden:
    """The meter's current transformer is off by a share."""
    sign = float(random.choice([-1, 1]))
    return Hidden(
        id="meter_gain", place="meter", unit="-", start=0.05, truth=lambda size: sign * size,
        meter=lambda power, volts, size: power * (1 + sign * size),
    )  # fmt: skip


def meter_saturation(session: Session, random: np.random.Generator) -> Hidden:
    """The meter shows no power above a ceiling."""

    def clipped(power: Floats, volts: Floats, size: float) -> Floats:
        low, high = np.percentile(power, [5, 99.9])
        return np.asarray(np.minimum(power, high - min(size, 0.95) * (high - low)))

    return Hidden(id="meter_saturation", place="meter", start=0.5, most=0.95, everywhere=True, meter=clipped)


def clock_offset(session: Session, random: np.random.Generator) -> Hidden:
    """The metered power is late by a constant time."""
    return Hidden(
        id="clock_offset", place="clocks", unit="s", start=0.05, most=0.6, late=lambda size: size,
        truth=lambda size: size,
    )  # fmt: skip


def clock_drift(session: Session, random: np.random.Generator) -> Hidden:
    """The metered power is late by a time that grows."""
    hours = session.motion.t / 3600
    return Hidden(
        id="clock_drift", place="clocks", unit="s/h", start=0.2, most=3.0, late=lambda size: size * hours,
        truth=lambda size: size,
    )  # fmt: skip


def _signal(signal: Floats, name: str, place: str) -> Hidden:
    return Hidden(
        id=name, place=place, unit="W", start=10.0, truth=lambda size: size,
        load=lambda drives, mains, size: size * signal,
    )  # fmt: skip


def _cabinet(on: Floats, name: str, details: dict[str, float]) -> Hidden:
    return Hidden(
        id=name, place="cabinet", unit="W", start=10.0, truth=lambda size: size, details=details,
        load=lambda drives, mains, size: size * on,
    )  # fmt: skip
