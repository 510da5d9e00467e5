"""`[events]` of acqd.toml."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field, model_validator

from acqd.daemon.section import Positive
from acqd.errors import SettingError
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.detector import EventDetector
from acqd.metering.quality.event import Event, Thresholds
from acqd.metering.quality.line_voltages import line_format, line_voltages
from acqd.metering.quality.reference import Declared, Reference, Sliding
from acqd.section import Section

_Percent = Annotated[float, Field(ge=0, le=300)]


class EventsSection(Section):
    """Dips, swells, interruptions, rapid voltage changes. Thresholds in % of the reference voltage."""

    enabled: bool = False
    declared_voltage: Positive | None = None
    """V, of sources without a `nominal_voltage`; there is no default, since nobody may guess it."""
    sliding_reference: bool = False
    line_to_line: bool = False
    """Watch the voltages between the lines, as in three-wire systems; `declared_voltage` is that between lines, too."""
    dip: _Percent = 90.0
    swell: _Percent = 110.0
    interruption: _Percent = 5.0
    hysteresis: _Percent = 2.0
    rapid_change: _Percent = 5.0
    transient: _Percent = 0.0
    waveforms: bool = True
    pre_s: Annotated[float, Field(ge=0, le=5)] = 0.2
    post_s: Annotated[float, Field(ge=0, le=60)] = 1.0
    keep_files: Annotated[int, Field(ge=1, le=100_000)] = 500
    keep_mb: Positive = 200.0

    @model_validator(mode="after")
    def _usable(self) -> EventsSection:
        self.thresholds()
        return self

    def thresholds(self) -> Thresholds:
        """As shares. Raises ValueError for thresholds that exclude each other."""
        return Thresholds(
            dip=self.dip / 100,
            swell=self.swell / 100,
            interruption=self.interruption / 100,
            hysteresis=self.hysteresis / 100,
            rvc=self.rapid_change / 100,
            transient=self.transient / 100,
        )

    def reference(self, phases: int, f_nominal: float) -> Reference:
        """What 100 % is."""
        return reference_of(self.declared_voltage, self.sliding_reference, phases, f_nominal)


class Watched:
    """The detector of a section, and the voltages that it watches."""

    def __init__(self, section: EventsSection, form: StreamFormat, first: int = 0) -> None:
        """`first`: number of the first event. Raises SettingError where the voltages between lines are not known."""
        self._form, self._lines = form, section.line_to_line
        try:
            watched = line_format(form) if section.line_to_line else form
        except ValueError as error:
            raise SettingError(f"events.line_to_line: {error}") from None
        reference = section.reference(form.phases, form.f_nominal)
        self.sliding = reference.sliding
        self._detector = EventDetector(watched, reference, section.thresholds(), first)

    def feed(self, block: SampleBlock) -> Iterator[Event]:
        """Events that begin or end in what `block` completes."""
        return self._detector.feed(line_voltages(block, self._form) if self._lines else block)

    def finish(self) -> Iterator[Event]:
        """The events in progress when the stream ends."""
        return self._detector.finish()


def reference_of(declared: float | None, sliding: bool, phases: int, f_nominal: float) -> Reference:
    """The declared voltage [V], or a sliding reference that begins with it where there is one."""
    if sliding or declared is None:
        return Sliding(phases, f_nominal, declared)
    return Declared(declared)
