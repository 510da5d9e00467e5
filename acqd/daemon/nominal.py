"""The voltage of each source that is 100 %: for events, flags of power quality, flicker and `no_mains`.

A source says it (`nominal_voltage`), the sections [events] and [metering] say it for all sources, or a simulation has
it. Nobody guesses it: without a word, 230 V only tells whether there is a voltage at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.quality_feed import UNDEFINED
from acqd.daemon.source_sections import SimulatedSection, SourceSection

if TYPE_CHECKING:
    from acqd.daemon.config import Config


def for_events(config: Config, source: SourceSection) -> float | None:
    """V; None: nobody says it."""
    return _own(source) or config.events.declared_voltage or _simulated(source)


def for_quality(config: Config, source: SourceSection) -> float | None:
    """V; None: nobody says it."""
    for_all = config.metering.nominal_voltage if "nominal_voltage" in config.metering.model_fields_set else None
    return _own(source) or for_all or config.events.declared_voltage or _simulated(source)


def applied(config: Config) -> Config:
    """A configuration with one source, with the voltage of that source in the sections that need one."""
    events = {"declared_voltage": for_events(config, config.source)}
    metering = {"nominal_voltage": for_quality(config, config.source) or config.metering.nominal_voltage}
    return config.model_copy(
        update={
            "events": config.events.model_copy(update=events),
            "metering": config.metering.model_copy(update=metering),
        }
    )


def check(config: Config) -> None:
    """Raises ValueError that names the first source whose voltage is needed and not known."""
    sources = [(box.device, box.source) for box in config.sources] or [(config.device, config.source)]
    for device, source in sources:
        f = source.nominal_frequency
        if not 45 <= f <= 65 and (config.events.enabled or config.quality.enabled):
            raise ValueError(f"the source of {device} has mains of {f:g} Hz: {UNDEFINED}")
        if isinstance(source, MetersSection):
            continue  # each meter has a voltage of its own, and no samples
        how = f"say what 100 % is in the source of {device}: nominal_voltage = 230.0"
        if config.events.enabled and not config.events.sliding_reference and for_events(config, source) is None:
            raise ValueError(
                f"events: declared_voltage is missing: {how}, or that it follows the voltage: "
                "[events] sliding_reference = true"
            )
        if config.quality.enabled and for_quality(config, source) is None:
            raise ValueError(f"quality: the voltage is missing: {how}, or for all sources in [metering]")


def _own(source: SourceSection) -> float | None:
    return None if isinstance(source, MetersSection) else source.nominal_voltage


def _simulated(source: SourceSection) -> float | None:
    return source.voltage if isinstance(source, SimulatedSection) else None
