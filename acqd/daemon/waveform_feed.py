"""Rows from samples: the cyclic executive, the meter and its energy registers."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from acqd.daemon.archive.origin import origin_of, state_of
from acqd.daemon.boot import Boot
from acqd.daemon.config import Config
from acqd.daemon.continued import FLAG, continued_from
from acqd.daemon.events.watch import Announce, EventWatch
from acqd.daemon.feed import ALONE, Company, Deliver, Sent
from acqd.daemon.health.snapshot import Cycles, FeedHealth, SourceLink
from acqd.daemon.quality_feed import UNDEFINED, DeliverQuality, QualityFeed
from acqd.daemon.register import RegisterFile, Run, greater, registers_of
from acqd.daemon.source_sections import WaveformSection
from acqd.daemon.tally import Tally
from acqd.metering import Meter, SampleBlock, StreamFormat, WindowBatch
from acqd.metering.energy import no_load_W
from acqd.metering.other_mains import meter_for
from acqd.metering.registers import Registers
from acqd.metering.signal_watch import SignalWatch
from acqd.metering.stages import Stages
from acqd.metering.wiring_watch import Wired, WiringWatch
from acqd.plc.executive import Executive
from acqd.plc.realtime import prioritise
from acqd.plc.recent import SampledWindow
from acqd.sources.waveform import Waveform
from acqd.telemetry.last_rows import Known
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.row import rows_of
from acqd.telemetry.spool import Energy, Readings
from acqd.telemetry.summary import Summariser

if TYPE_CHECKING:  # libsndfile is loaded only where samples are kept
    from acqd.archive.track import Track

_log = logging.getLogger(__name__)
_STALE_S = 2.0  # rows are missing when none has come for this long


class WaveformFeed:
    """One stream of samples."""

    def __init__(
        self,
        config: Config,
        source: WaveformSection,
        boot: str,
        deliver: Deliver,
        sent: Sent | None = None,
        deliver_quality: DeliverQuality | None = None,
        announce: Announce | None = None,
        company: Company = ALONE,
    ) -> None:
        """`sent`: what is known of the rows of earlier starts; `announce` takes events."""
        self._config = config
        self._sent, self._known = sent, None if sent is None else sent.readings(config.device)
        self._unread = [] if sent is None else sent.unread(config.device)
        self._register = RegisterFile(config.state_dir, config.device) if config.state_dir else None
        self._last_run = self._register.last_run() if self._register is not None else None
        self._before: Known | None = None
        self._asking: asyncio.Task[None] | None = None
        self._unconfirmed, self._stopped = self._last_run is not None and self._last_run.unconfirmed, False
        self._boot = Boot(boot)
        self._deliver = deliver
        self._quality = (
            QualityFeed(
                config.quality,
                config.device,
                config.metering.nominal_voltage,
                lambda: self._boot.name,
                source.correction.responses,
            )
            if deliver_quality is not None and config.quality.enabled
            else None
        )
        self._deliver_quality = deliver_quality
        self._first_boot, self._announce = boot, announce
        self._events: EventWatch | None = None
        self._correction = source.correction
        self._signals: SignalWatch | None = None
        self._wiring: WiringWatch | None = None
        self._mistakes: list[str] = []  # that the log names
        self._of = f" of {company.name}" if company.name else ""
        self._saving = threading.Lock()
        self._registers: Registers | None = None
        self._summariser, self._tally = Summariser(), Tally()
        self._last_row: float | None = None
        self._newest: tuple[int, Energy] | None = None
        self._begun = time.monotonic()
        self._cycles = Cycles()
        self._refused: list[str] = []
        self._source, self._archive = source, company.archive
        self._track: Track | None = None
        self._executive = Executive(
            source.spec(),
            self._make_meter,
            self._take,
            window=config.window,
            realtime=config.realtime.settings(),
            makers=[*source.makers, self._make_signals],
            make_watch=self._make_watch,
            make_keeper=self._make_keeper if self._archive is not None else None,
            before_meter=self._asked,
            of=company.name,
            spawn=company.spawn,
        )

    @property
    def refused(self) -> list[str]:
        """Real-time settings that this host does not permit."""
        return self._executive.refused + self._refused

    async def start(self) -> None:
        """Start MAIN_FAST, and ask meanwhile what is stored. Raises UserError when its source cannot be used."""
        self._asking = asyncio.create_task(self._ask())
        try:
            await self._executive.start()
        finally:
            self._asking.cancel()
        self._refused = prioritise("MAIN_SLOW", self._config.realtime.slow_priority)
        self._begun = time.monotonic()

    async def _ask(self) -> None:
        """What others know of the last rows of a run that did not end."""
        run = self._register.unfinished() if self._register is not None else None
        if self._sent is not None and run is not None:
            self._before = await self._sent.last_rows(self._config.device)
            self._unconfirmed |= run.cut_off and (self._before is None or not self._before.answered)

    async def _asked(self) -> None:
        if self._asking is not None:
            await self._asking

    async def run(self) -> None:
        """Make rows until the source ends or `stop` is called."""
        try:
            await self._executive.run()
        finally:
            if self._events is not None:
                self._events.finish()
            if self._quality is not None:
                self._put_quality(self._quality.finish())
            if self._track is not None:
                self._track.finish()

    async def stop(self) -> None:
        """End after the current window."""
        await self._executive.stop()
        self._stopped = True

    def close(self) -> None:
        """Release the ring and its descriptors."""
        self._executive.close()

    def save(self) -> None:
        """Write the energy registers; from any thread."""
        if self._register is not None and self._executive.meter is not None:
            with self._saving:  # a later reading is never overwritten by an earlier one
                others = self._registers.state() if self._registers is not None else None
                seq, energy = self._newest or (-1, self._executive.meter.energy.reading())
                run = Run(self._boot.name, seq, self._stopped, unconfirmed=self._unconfirmed)
                self._register.save(energy, others, run)

    def alive(self) -> bool:
        """Whether rows arrive, or the device or MAIN_FAST is away and its supervisor brings it back."""
        if time.monotonic() - (self._last_row or self._begun) < _STALE_S:
            return True
        return not self._executive.health.connected or self._executive.relaunching

    def health(self) -> FeedHealth:
        """Connection to the device, cycles of MAIN_FAST, clock."""
        executive, last = self._executive, self._last_row
        lost = executive.health
        with contextlib.suppress(ValueError):  # the ring is being replaced: the figures of the last look hold
            summary = executive.cycle_summary()
            self._cycles = Cycles(
                summary.cycles, summary.late, summary.missed, summary.exceeded, executive.restarts,
                executive.latencies(), executive.durations(),
            )  # fmt: skip
        return FeedHealth(
            self._boot.name,
            SourceLink(lost.connected, lost.reconnects, lost.reason, lost.lost),
            None if last is None else time.monotonic() - last,
            self._cycles,
            executive.clock.synchronised,
            self._tally.total(),
            register_trouble=self._register.trouble if self._register is not None else "",
        )

    def window(self, device: str) -> tuple[str, SampledWindow | None] | None:
        """The newest window; None for another device's name. May be asked in any thread."""
        recent = self._executive.recent
        if device not in ("", self._config.device):
            return None
        return self._config.device, recent.window() if recent is not None else None

    def capture(self, device: str, seconds: float) -> Waveform | None:
        """The newest samples, out of the ring."""
        recent = self._executive.newest(seconds) if device in ("", self._config.device) else None
        if recent is None:
            return None
        block, form = recent
        return Waveform(self._config.device, block.codes, form, block.utc_ns, "simulated" in block.flags)

    def status(self) -> dict[str, Any]:
        """Health of the source, statistics of MAIN_FAST and MAIN_SLOW."""
        executive = self._executive
        return {
            "simulated": "simulated" in executive.flags,
            "source_health": asdict(executive.health),
            "main_fast": executive.cycle_summary().as_dict() | {"restarts": executive.restarts},
            "main_slow": {"mean_us": executive.slow_us()},
            "wiring": (self._wiring.wired if self._wiring is not None else Wired()).as_dict(self._correction.after),
        }

    def _make_signals(self, form: StreamFormat) -> SignalWatch | None:
        """The stage that flags samples; none for captures, which run through stages that are made later."""
        if self._signals is not None:
            return None
        self._signals = SignalWatch(form)
        return self._signals

    def _make_meter(self, form: StreamFormat) -> Meter:
        metering, window = self._config.metering, self._config.window
        energy = self._energy(form.phases)
        others = self._register.others if self._register is not None else None
        spooled = self._known.registers if self._known is not None else None
        creep_W = metering.creep_w
        if creep_W is None:
            creep_W = no_load_W(form, metering.nominal_voltage)
        self._registers = registers_of(form.phases, window, creep_W, others, spooled)
        return meter_for(
            form,
            window=window,
            mode=metering.mode,
            nominal_voltage=metering.nominal_voltage,
            energy=energy,
            creep_W=creep_W,
        )

    def _energy(self, phases: int) -> Energy | None:
        """Registers to continue from: the greater of file and spool, so that W never goes back.

        Then later rows: in the spool, and after a power cut those that others know. It is on the disk, with the boot,
        before the first row leaves.
        """
        spooled = self._known.energy if self._known is not None else None
        energy = greater(self._register.load(phases) if self._register else None, spooled, phases)
        if energy is not None:
            energy = continued_from(energy, self._last_run, self._known, self._before, self._unread)
        if self._register is not None:
            self._unconfirmed |= self._register.refused
            begin, run = energy or [(0.0, 0.0)] * phases, Run(self._boot.name, -1, unconfirmed=self._unconfirmed)
            self._register.save(begin, self._register.others, run, first=True)
        return energy

    def _take(self, batch: WindowBatch) -> None:
        rows = list(rows_of(batch, self._config.device, self._boot.name))
        self._boot.stamp(rows)
        if self._unconfirmed:
            self._unconfirmed = False
            for row in rows:
                if row.seq == rows[0].seq:  # of the first window, however many have come together
                    row.flags = sorted({*row.flags, FLAG})
        self._tally.add(rows)
        assert self._executive.meter is not None and self._registers is not None
        # These are of the second before: with the registers from before this batch.
        summaries = [each | self._registers.reading(each["channel"]) for each in self._summariser.add(batch, rows)]
        self._registers.add(batch)
        energy = self._executive.meter.energy.reading()
        if rows:
            self._newest = rows[-1].seq, energy
        self._deliver(rows, summaries, Readings(energy, self._registers.numbers()))
        self._last_row = time.monotonic()

    def _make_watch(self, form: StreamFormat) -> Callable[[SampleBlock], None]:
        config = self._config
        self._wiring = WiringWatch(form, config.metering.nominal_voltage)
        if not form.usual and (self._quality is not None or config.events.enabled):
            _log.warning("mains of %g Hz%s: %s", form.f_nominal, self._of, UNDEFINED)
            self._quality = None
            return self._watch
        if self._quality is not None:
            self._quality.open(form)
        if config.events.enabled:
            announce = self._announce or (lambda _: None)
            self._events = EventWatch(
                config.events, form, config.device, self._first_boot, announce, config.state_dir, self._where
            )
        return self._watch

    def _make_keeper(self, form: StreamFormat, stages: Stages, meter: Meter) -> Callable[[list[SampleBlock]], None]:
        assert self._archive is not None
        origin = origin_of(self._config, self._source, form, meter)
        self._track = self._archive.track(origin, lambda: (self._boot.name, state_of(stages, meter, self._boot)))
        return self._track.take

    def _where(self, index: int) -> tuple[str, int] | None:
        return self._track.where(index) if self._track is not None else None

    def _watch(self, block: SampleBlock) -> None:
        assert self._wiring is not None
        self._wiring.feed(block)
        findings = self._wiring.wired.findings
        if (mistakes := [one.mistake for one in findings]) != self._mistakes:
            self._mistakes = mistakes
            for one in findings:
                _log.warning(
                    "wiring%s: %s%s", self._of, one.text, one.correction and f"; {self._correction.after(one)}"
                )
            if not findings:
                _log.info("wiring%s: nothing is wrong any more", self._of)
        if self._events is not None:
            self._events.feed(block)
        if self._quality is not None:
            self._put_quality(self._quality.take(block))

    def _put_quality(self, rows: list[QualityRow]) -> None:
        if rows and self._deliver_quality is not None:
            self._deliver_quality(rows)
