"""What holds for everything that shows a cost: the tariff of [energy] in acqd.toml, and where a day begins."""

from __future__ import annotations

from dataclasses import dataclass
from zoneinfo import ZoneInfo

from acqd.daemon.energy_section import EnergySection
from acqd.energy.periods import zone_of
from acqd.energy.tariff import Tariff, load_tariff


@dataclass(frozen=True, slots=True)
class Rules:
    """Prices and local time."""

    tariff: Tariff | None
    """None: energies have no cost."""
    zone: ZoneInfo


def rules_of(section: EnergySection) -> Rules:
    """Read the tariff. Raises UserError."""
    tariff = None if section.tariff is None else load_tariff(section.tariff, section.zone)
    of_tariff = None if section.zone is not None or tariff is None else tariff.zone
    return Rules(tariff, of_tariff or zone_of(section.zone))
