"""A box without a device: samples through stages, meter and boot as MAIN_SLOW does it, kept by an archive."""

import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acqd.archive.recorder import Recorder
from acqd.archive.ring import Limits
from acqd.daemon.archive.origin import origin_of, state_of
from acqd.daemon.boot import Boot
from acqd.daemon.config import Config
from acqd.metering import SampleBlock
from acqd.metering.block import StreamFormat
from acqd.metering.other_mains import meter_for
from acqd.metering.signal_watch import SignalWatch
from acqd.metering.stages import Stages
from acqd.telemetry.row import PowerRow, rows_of

RATE = 20_000.0
FORM = StreamFormat(RATE, (0.02, 0.0003) * 3)
UTC = 1_790_000_000_000_000_000
WIDE = Limits(10**12, 1e9, 0)


def mains(seconds: float, phases: int = 3, seed: int = 1) -> np.ndarray:
    """Codes [samples, 2 * phases] of steady mains with noise, and a dip of all phases now and then."""
    t, rng = np.arange(round(seconds * RATE)) / RATE, np.random.default_rng(seed)
    codes = np.empty((len(t), 2 * phases), np.int16)
    dip = np.where((t % 1.3) > 1.2, 0.6, 1.0)
    for k in range(phases):
        angle = 2 * np.pi * 50.01 * t - k * 2 * np.pi / 3
        codes[:, 2 * k] = np.rint(16_000 * dip * np.sin(angle) + rng.normal(0, 3, len(t)))
        codes[:, 2 * k + 1] = np.rint(9_000 * np.sin(angle - 0.5) + rng.normal(0, 6, len(t)))
    return codes


@dataclass
class FakeBox:
    """One stream of a daemon."""

    recorder: Recorder
    config: Config = field(default_factory=lambda: Config(device="box"))
    form: StreamFormat = FORM
    boot: str = "b0"
    rows: list[PowerRow] = field(default_factory=list)
    blocks: list[SampleBlock] = field(default_factory=list)

    def __post_init__(self):
        self.stages = Stages(self.form, [*self.config.source.makers, SignalWatch])
        self.meter = meter_for(self.stages.form)
        self._boot = Boot(self.boot)
        origin = origin_of(self.config, self.config.source, self.form, self.meter)
        self.track = self.recorder.track(
            origin, lambda: (self._boot.name, state_of(self.stages, self.meter, self._boot))
        )

    def cycle(self, blocks: list[SampleBlock]) -> None:
        """As SlowTask does it."""
        self.track.take(blocks)
        self.blocks += blocks
        for block in blocks:
            ready = self.stages.apply(block)
            batch = None if ready is None else self.meter.feed(ready)
            if batch is not None:
                rows = list(rows_of(batch, self.config.device, self._boot.name))
                self._boot.stamp(rows)
                self.rows += rows

    def feed(self, codes, at: int = 0, utc: int = UTC, flags: frozenset[str] = frozenset(), window: int = 800) -> None:
        """Samples from number `at` on, a window a cycle."""
        for k in range(0, len(codes), window):
            stamp = utc + round((at + k) * 1e9 / self.form.rate)
            self.cycle([SampleBlock(codes[k : k + window], at + k, stamp, 0, flags)])


def recorder(root: Path, limits: Limits = WIDE, segment_s: float = 0.8) -> Recorder:
    """With short segments."""
    made = Recorder(root, limits, segment_s=segment_s, chunk_s=0.1)
    until(lambda: made.ready or made.latest.trouble)
    return made


def until(condition) -> None:
    """Wait for a thread; the test ends by the suite's guard where it never comes."""
    while not condition():
        time.sleep(0.005)
