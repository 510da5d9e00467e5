"""The chain under test: codes of a terminal, meter, rows as messages, SQL, and the values that SQL returns.

Nothing is judged before it was encoded, decoded by the writer of the sink and stored in a database. MQTT and the
cyclic tasks are left out: they carry the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import sqlalchemy as sa
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.conformance.signal import Signal
from acqd.conformance.terminal import Terminal
from acqd.errors import OperationError
from acqd.metering import Meter, SampleBlock
from acqd.metering.energy import no_load_W
from acqd.metering.quality.detector import EventDetector
from acqd.metering.quality.flicker import PinstStream
from acqd.metering.quality.flicker_values import FlickerValues, lamp_of
from acqd.metering.quality.meter import QualityMeter
from acqd.metering.quality.quantities import DEFAULT, Options
from acqd.metering.quality.reference import Declared
from acqd.metering.synchrophasor import SynchrophasorMeter
from acqd.storage import schema
from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.writer import Writer
from acqd.telemetry import topics
from acqd.telemetry.event import message_of
from acqd.telemetry.quality_row import quality_rows
from acqd.telemetry.row import rows_of

DEVICE = "conformance"
Part = Literal["rows", "quality", "flicker", "events"]
_BATCH = 2_000  # messages in a transaction
_SIMULATED = frozenset({"simulated"})


@dataclass(frozen=True, slots=True)
class Readings:
    """What the database holds of one signal."""

    rows: list[Mapping[str, Any]] = field(default_factory=list)
    quality: list[Mapping[str, Any]] = field(default_factory=list)
    events: list[Mapping[str, Any]] = field(default_factory=list)

    def row(self, name: str, channel: str) -> Floats:
        """A column of the windows of a channel; NaN for null."""
        return _column([one[name] for one in self.rows if one["channel"] == channel])

    def of(self, aggregation: str, name: str, channel: str) -> Floats:
        """A column of quality values, [values] or [values, 50]; NaN for null."""
        return _column([one[name] for one in self.aggregated(aggregation, channel)])

    def aggregated(self, aggregation: str, channel: str) -> list[Mapping[str, Any]]:
        """Quality rows of one aggregation and channel."""
        return [one for one in self.quality if (one["aggregation"], one["channel"]) == (aggregation, channel)]


def _column(values: list[Any]) -> Floats:
    return np.array(values, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class PhasorSeries:
    """Synchrophasors of a signal."""

    t: Floats
    """[reports] s since the first sample."""
    positive: NDArray[np.complex128]
    """V."""
    f: Floats
    """Hz."""
    rocof: Floats
    """Hz/s."""

    def inner(self, count: int) -> PhasorSeries:
        """Without so many reports at both ends."""
        part = slice(count, -count)
        return PhasorSeries(self.t[part], self.positive[part], self.f[part], self.rocof[part])


class Instrument:
    """A meter of acqd behind a terminal."""

    def __init__(self, terminal: Terminal) -> None:
        self.terminal = terminal
        self._engine = open_database("sqlite:///:memory:")
        self._writer = Writer(self._engine)
        self._signals = 0

    def blocks(self, signal: Signal) -> Iterator[SampleBlock]:
        """The samples of a signal as the terminal delivers them, a window at a time."""
        terminal, rate = self.terminal, self.terminal.rate
        count, size = round(signal.seconds * rate), self.terminal.samples_per_window
        for first in range(0, count, 16 * size):
            t = np.arange(first, min(first + 16 * size, count)) / rate
            codes = terminal.codes(signal.wave(t), seed=first)
            for k in range(0, len(codes), size):
                index = first + k
                stamp = signal.start_ns + round(index * 1e9 / rate)
                yield SampleBlock(codes[k : k + size], index, stamp, flags=_SIMULATED)

    def read(self, signal: Signal, *parts: Part, options: Options = DEFAULT) -> Readings:
        """Meter a signal, and read from the database what `parts` of the chain have made of it."""
        self._signals += 1
        boot, waiting = f"signal{self._signals}", list[Received]()
        for messages in self._messages(signal, boot, parts, options):
            waiting += messages
            if len(waiting) >= _BATCH:
                self._store(waiting)
                waiting = []
        self._store(waiting)
        return self._stored(boot)

    def pinst(self, signal: Signal) -> Floats:
        """Instantaneous flicker sensation [phases, values] of a signal: no row holds it."""
        terminal = self.terminal
        lamp = lamp_of(terminal.declared_voltage)
        stream = PinstStream(3, terminal.rate, float(terminal.f_nominal), lamp)
        codes = np.concatenate([block.codes for block in self.blocks(signal)])
        u = codes[:, 0::2].T * np.asarray(terminal.form.scale[0::2])[:, None]
        chunk = stream.step * stream.thin
        return stream.feed(u[:, : u.shape[1] // chunk * chunk])

    def phasors(self, signal: Signal) -> PhasorSeries:
        """Synchrophasors of a signal: no row holds them."""
        meter = SynchrophasorMeter(self.terminal.form, 0.05 * self.terminal.declared_voltage)
        reports = [report for block in self.blocks(signal) for report in meter.feed(block)]
        return PhasorSeries(
            np.array([(one.utc_ns - signal.start_ns) * 1e-9 for one in reports]),
            np.array([one.positive for one in reports]),
            np.array([one.f for one in reports]),
            np.array([one.rocof for one in reports]),
        )

    def _messages(
        self, signal: Signal, boot: str, parts: tuple[Part, ...], options: Options
    ) -> Iterator[list[Received]]:
        form, declared = self.terminal.form, self.terminal.declared_voltage
        meter = Meter(form, window=self.terminal.window, nominal_voltage=declared, creep_W=no_load_W(form, declared))
        quality = QualityMeter(form, declared_voltage=declared, options=options)
        flicker = FlickerValues(form, declared)
        detector = EventDetector(form, Declared(declared))
        seq = 0
        for block in self.blocks(signal):
            found: list[Received] = []
            if "rows" in parts and (batch := meter.feed(block)) is not None:
                found += [
                    Received(topics.power(DEVICE, row.channel), row.to_json()) for row in rows_of(batch, DEVICE, boot)
                ]
            values = [] if "quality" not in parts else list(quality.feed(block))
            values += [] if "flicker" not in parts else list(flicker.feed(block))
            for one in values:
                found += [
                    Received(topics.row(DEVICE, topics.quality_stream(row.channel)), row.to_json())
                    for row in quality_rows(one, DEVICE, boot, seq)
                ]
                seq += 1
            if "events" in parts:
                found += [
                    Received(topics.event(DEVICE), message_of(event, DEVICE, boot, sliding=False).to_json())
                    for event in detector.feed(block)
                ]
            yield found

    def _store(self, messages: list[Received]) -> None:
        written = self._writer.write(messages)
        if written.quarantined:
            raise OperationError(
                f"conformance: the database refused {written.quarantined} rows; this is a fault of acqd"
            )

    def _stored(self, boot: str) -> Readings:
        """Rows of a boot in the order of their numbers; the next signal needs none of them."""
        found: list[list[Mapping[str, Any]]] = []
        with self._engine.begin() as connection:
            for table, order in ((schema.power, "seq"), (schema.power_quality, "seq"), (schema.power_event, "number")):
                chosen = sa.select(table).where(table.c.boot == boot).order_by(table.c[order])
                found.append([dict(row) for row in connection.execute(chosen).mappings()])
                connection.execute(sa.delete(table).where(table.c.boot == boot))
        return Readings(*found)
