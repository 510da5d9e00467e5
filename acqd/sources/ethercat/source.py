"""EL3783 terminals as a source: one exchange a cycle, blocks recognised by their DC time, recovery step by step."""

from __future__ import annotations

import time

from acqd.errors import UserError
from acqd.retry import Backoff
from acqd.sources.device import Clock, DeviceSource, stream_format
from acqd.sources.ethercat.assemble import Assembler
from acqd.sources.ethercat.bus import SegmentError
from acqd.sources.ethercat.lock import PhaseLock
from acqd.sources.ethercat.segment import Segment
from acqd.sources.ethercat.settings import EthercatSettings

_POLLS = 4  # of a block, unless the cycle is locked to it: more often is harmless, less often loses blocks
_LOCKED_NS = 2_000_000  # a block this short is read once, with the wake-up locked to SYNC1
_PATIENCE_NS = 30_000_000  # of wrong working counters: single lost frames are no outage
_CHECK_NS = 500_000_000  # between looks at the slaves' states
_START_TRIES = 5
_START_PAUSE_S = 0.2  # before the second try; each further one waits so much longer
_STANDSTILL_NS = 1_000_000_000  # without a new block, while frames come back: SYNC starts 0.1 s after OP
_ACKNOWLEDGE_NS = 1_500_000_000  # for slaves to come back to OP before the segment is started again


class EthercatSource(DeviceSource):
    """One to three EL3783 behind a coupler."""

    patience_s = 12.0  # a segment that is started again waits for mailboxes and changes of state

    def __init__(self, settings: EthercatSettings, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(clock)
        self._settings = settings
        settings.places()  # refuses phases that are not there before the segment is touched
        self._segment: Segment | None = None
        self._backoff = Backoff()
        self._good_ns = 0  # last exchange with the right working counter
        self._checked_ns = 0
        self._fresh_ns = 0  # last exchange with a new block
        self._trouble = ""  # which slave is not in OP although samples come
        self._stamps: list[bytes] = []
        self._lock: PhaseLock | None = None
        self._phase: tuple[int, int] | None = None  # DC time of the last exchange and of the SYNC1 before

    def connect(self) -> None:
        """Bring the terminals to OP. Raises UserError."""
        self._start_patiently()
        assert self._segment is not None
        bits = 32 if self._settings.current_range == "auto" else 16
        rate = 1e9 / self._settings.sample_ns
        self._declare(stream_format(rate, self._settings.scale, self._settings.f_nominal, bits=bits))
        block_ns = self._segment.block_ns
        if block_ns <= _LOCKED_NS:
            self.period_ns, self._lock = block_ns, PhaseLock(block_ns)
        else:
            self.period_ns = block_ns // _POLLS

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start with the next block."""
        super().open(utc_ns, index)
        self._good_ns = self._checked_ns = self._fresh_ns = self._clock()

    def exchange(self) -> None:
        """One cyclic frame, or one step of the recovery."""
        now = self._clock()
        if self._segment is None:
            self._start_again(now)
            return
        images = self._segment.exchange()
        if images is None:
            self._missed(now)
            return
        self._good_ns = now
        self._take(images, now)
        if now - self._checked_ns > _CHECK_NS:
            self._check(now)

    def correction_ns(self) -> int:
        """Shift that holds the wake-up half a block behind SYNC1; none while polling several times a block."""
        if self._lock is None or self._phase is None:
            return 0
        correction = self._lock.correction_ns(*self._phase)
        self._phase = None
        return correction

    def close(self) -> None:
        """Leave the terminals in INIT."""
        if self._segment is not None:
            self._segment.close()
            self._segment = None

    def _start_patiently(self) -> None:
        """One lost frame fails the start-up of a segment: only what fails again and again is an error."""
        for attempt in range(1, _START_TRIES + 1):
            try:
                self._adopt(Segment.start(self._settings))
            except SegmentError as error:
                if attempt == _START_TRIES:
                    raise UserError(f"EtherCAT on {self._settings.interface}: {error}") from None
                time.sleep(attempt * _START_PAUSE_S)
            else:
                return

    def _adopt(self, segment: Segment) -> None:
        self._segment = segment
        layout = segment.layout
        self._assembler = Assembler(self._settings, segment.block_ns, layout.oversampling, layout.count[1])

    def _take(self, images: list[bytes], now: int) -> None:
        assert self._segment is not None
        layout, block_ns = self._segment.layout, self._segment.block_ns
        stamps = [layout.stamp(image) for image in images]
        if stamps == self._stamps:  # the blocks of the exchange before: most are, when each is read four times
            return
        self._stamps = stamps
        dc_time_ns = self._segment.dc_time_ns
        for period in self._assembler.add([layout.decode(image, dc_time_ns) for image in images]):
            self._fresh_ns = now
            counter = round(period.begin_ns / self._settings.sample_ns)
            self._place(period.codes, counter, now - block_ns, period.flags)
            self._phase = (dc_time_ns, period.begin_ns)
            self._find(self._trouble or period.warning)

    def _missed(self, now: int) -> None:
        """A wrong working counter: nothing of this exchange is used; a run of them is an outage."""
        away_ns = now - self._good_ns
        if away_ns < _PATIENCE_NS:
            return
        self._check(now)
        if self._segment is None:
            return
        self._lose(self._trouble or "frames are lost; check cable and interface")
        if away_ns > _ACKNOWLEDGE_NS:
            self._restart()

    def _check(self, now: int) -> None:
        """Look at the slaves' states: take those that fell out of OP back, give the segment up where that fails."""
        assert self._segment is not None
        self._checked_ns = now
        self._trouble = self._segment.trouble() or ""
        if self._trouble and not self._segment.acknowledge() and now - self._good_ns > _PATIENCE_NS:
            self._lose(self._trouble)
            self._restart()
        elif now - self._fresh_ns > _STANDSTILL_NS:
            self._lose(self._trouble or "the terminals deliver no new blocks; is their distributed clock running?")
            self._restart()

    def _restart(self) -> None:
        """Give the segment up; `exchange` starts it again. That sets its clock, so time places the samples."""
        self.close()
        self._trouble = ""
        self._numbering.restart()
        self._backoff.reset()

    def _start_again(self, now: int) -> None:
        if not self._backoff.due(now):
            return
        try:
            self._adopt(Segment.start(self._settings))
        except (SegmentError, UserError) as error:
            self._lose(str(error))
            return
        self._good_ns = self._checked_ns = self._fresh_ns = self._clock()
