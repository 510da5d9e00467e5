"""The change that a trial hides: what a technician may find at a robot, of a size that matters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.lab.effects import EffectSpec, known_effects

_STREAM = 611
"""First number of the random stream, so that motions of the same seed are independent."""


@dataclass(frozen=True, slots=True)
class Change:
    """A kind of change, from small but worth a visit to large."""

    id: str
    about: str
    """What happened, in a sentence without its size."""
    parameter: str
    """Of the laboratory's effect: its size."""
    smallest: float
    largest: float
    unit: str
    axes: tuple[int, ...] = ()
    """One of these has changed; empty: the effect has no axis."""
    part: str = "joint"
    """What an axis is called in a closing report."""
    named: str = ""
    """Parameter of a closing report that is the same quantity; empty: the loop fits another one."""


CHANGES = (
    Change("payload", "a mass hangs at the flange", "mass_kg", 0.6, 2.5, "kg", named="mass"),
    Change("gravity_bias", "a mass sits on a link", "mass_kg", 0.8, 2.0, "kg", (2, 3, 4), "link", "mass"),
    Change("coulomb_friction", "the dry friction of a joint has risen", "relative", 0.5, 1.2, "", (1, 2, 3, 4)),
    Change("viscous_friction", "the friction that grows with speed has risen in a joint", "relative", 0.8, 2.0, "",
           (1, 2, 3, 4)),
    Change("copper_loss", "the windings of the motors lose more", "relative", 0.6, 1.5, "", named="loss, relative"),
    Change("offset_shift", "something on the same supply takes power all the time", "power_W", 4.0, 20.0, "W",
           named="power"),
    Change("thermostat", "a heater switches on and off", "power_W", 10.0, 25.0, "W"),
    Change("supply_efficiency", "the power supply loses more the harder it works", "loss_at_100W", 5.0, 12.0, "W",
           named="loss at 100 W"),
)  # fmt: skip
"""Changes that a minute of random motion can show; the laboratory has others (`acqd lab effects`)."""


@dataclass(frozen=True, slots=True)
class Hidden:
    """What a trial hides."""

    change: Change
    size: float
    axis: int
    """From 1; 0: no single axis."""

    @property
    def effect(self) -> EffectSpec:
        """The effect of the laboratory."""
        axis = {"axis": float(self.axis)} if self.axis else {}
        return EffectSpec(id=self.change.id, values={self.change.parameter: self.size, **axis}, declared=False)

    @property
    def where(self) -> str:
        """Joint or link, or nothing."""
        return f"{self.change.part} {self.axis}" if self.axis else ""

    @property
    def sized(self) -> str:
        """The size with its unit; a relative one as a percentage."""
        return f"{self.size:.3g} {self.change.unit}" if self.change.unit else f"{100 * self.size:+.0f} %"


def drawn(seed: int) -> Hidden:
    """The change of a seed: every kind is as likely, every size within its bounds, on a logarithmic scale."""
    random = np.random.default_rng([seed, _STREAM])
    change = CHANGES[int(random.integers(len(CHANGES)))]
    size = float(np.exp(random.uniform(np.log(change.smallest), np.log(change.largest))))
    axis = int(random.choice(change.axes)) if change.axes else 0
    assert change.parameter in known_effects()[change.id].defaults
    return Hidden(change, float(f"{size:.2g}"), axis)
