"""Rows of power quality from the blocks that the meter is fed with."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from itertools import chain
from typing import TypeAlias

from acqd.daemon.quality_section import QualitySection
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.gathered import Gathered
from acqd.metering.quality.flicker_values import FlickerValues
from acqd.metering.quality.meter import QualityMeter
from acqd.metering.quality.quantities import OFF_NOMINAL
from acqd.metering.quality.response import IDEAL, Responses
from acqd.metering.quality.telegram import SIGNALLING, telegram_only
from acqd.metering.quality.values import QualityValues
from acqd.telemetry.quality_row import QualityRow, from_kind, quality_rows

_log = logging.getLogger(__name__)
DeliverQuality: TypeAlias = Callable[[list[QualityRow]], None]


UNDEFINED = "power quality, events and flicker are defined for 50 and 60 Hz (IEC 61000-4-30); meter without them"
"""Why mains of other frequencies have none."""
GATHERED_S = 0.2
"""Of samples that are metered together: about an interval."""


class QualityFeed:
    """One stream; `take` is called in MAIN_SLOW with every block, before or after its windows are metered."""

    def __init__(
        self,
        section: QualitySection,
        device: str,
        declared_voltage: float,
        boot: Callable[[], str],
        responses: Callable[[StreamFormat], Responses] = lambda _: IDEAL,
    ) -> None:
        """`boot` names the boot of the rows; `declared_voltage` [V] is that of the flags dip and swell; `responses`:
        of the transformers before a stream.
        """
        self._responses = responses
        self._kinds, self._section = from_kind(section.interval), section
        self._device, self._declared, self._boot = device, declared_voltage, boot
        self._meter: QualityMeter | None = None
        self._flicker: FlickerValues | None = None
        self._gathered = Gathered(0)
        self._seq = 0
        self._off_nominal = False  # whether the log says so

    def open(self, form: StreamFormat) -> None:
        """Begin a stream of this format."""
        self._meter = QualityMeter(
            form, declared_voltage=self._declared, options=self._section.options(self._responses(form))
        )
        self._flicker = FlickerValues(form, self._declared) if self._section.flicker else None
        self._gathered = Gathered(round(GATHERED_S * form.rate))

    def take(self, block: SampleBlock) -> list[QualityRow]:
        """Rows that the block completes; they may come a fifth of a second later."""
        return self._rows(self._gathered.add(block))

    def finish(self) -> list[QualityRow]:
        """Rows that the last samples complete: no more will come."""
        rows = self._rows(self._gathered.rest())
        return rows if self._flicker is None else [*rows, *self._rows_of(self._flicker.rest())]

    def _rows(self, blocks: Iterable[SampleBlock]) -> list[QualityRow]:
        return [row for block in blocks for row in self._of_block(block)]

    def _of_block(self, block: SampleBlock) -> list[QualityRow]:
        assert self._meter is not None
        flicker = self._flicker.feed(block) if self._flicker is not None else ()
        return self._rows_of(chain(self._meter.feed(block), flicker))

    def _rows_of(self, found: Iterable[QualityValues]) -> list[QualityRow]:
        rows: list[QualityRow] = []
        for values in found:
            self._notice(OFF_NOMINAL in values.flags)
            if values.kind not in self._kinds:
                if SIGNALLING not in values.flags:
                    continue
                values = telegram_only(values)
            rows += quality_rows(values, self._device, self._boot(), self._seq)
            self._seq += 1
        return rows

    def _notice(self, off_nominal: bool) -> None:
        """One line in the log when the mains turns out to have another frequency than configured."""
        if off_nominal and not self._off_nominal:
            assert self._meter is not None
            _log.warning(
                "%s: no fundamental near %g Hz: power quality without harmonics, fundamentals and unbalance, flagged "
                "%s; check f_nominal of the source",
                self._device, self._meter.form.f_nominal, OFF_NOMINAL,
            )  # fmt: skip
        self._off_nominal |= off_nominal
