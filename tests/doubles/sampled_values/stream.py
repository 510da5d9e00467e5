"""One stream of sampled values: frame number in, octets out."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field

import numpy as np

from tests.doubles.sampled_values import quality as q
from tests.doubles.sampled_values.frame import MAX_FRAME, Asdu, Link, sav_pdu, sv_frame, utc_time
from tests.doubles.sampled_values.wave import SvWave, Wave

USUAL_ASDUS = {4000: 1, 4800: 2, 12800: 8, 14400: 6}
"""ASDUs a frame at each rate [1/s]: 9-2LE at 50 Hz (80 and 256 samples a cycle), IEC 61869-9 (4800, 14400)."""
EPOCH_S = 1_700_000_000
"""Second since 1970 of sample 0, for refrTm."""
DESTINATION = bytes.fromhex("010ccd040000")
"""First multicast address for sampled values; IEC 61850-9-2 recommends 01-0C-CD-04-00-00 to 01-0C-CD-04-01-FF."""
SOURCE = bytes.fromhex("020000000001")


@dataclass
class SvStream:
    """A stream of `rate` samples/s with `asdus` samples a frame.

    Sample n (counted from the start, never reset) carries `wave.channels(n, 1)`; its smpCnt is
    (n - restarted_at + first_count) modulo `rate`, so it is 0 at each second pulse of a synchronised unit.
    `layout` names how many currents and voltages of `wave.CHANNELS` each sample has ("I4U4" is 9-2LE, others are
    data sets of IEC 61869-9). `quality` has a word for each of the 8 channels, of the layout or not.
    `long_lengths` is the number of octets of each BER length field in the long form, 0 for the shortest form.
    The fields after `drift_ppm` may change between two frames. Raises ValueError for what the wire cannot carry.
    """

    rate: int = 4800
    asdus: int = 2
    svid: str = "MU0101"
    appid: int = 0x4000
    vlan: int | None = None
    prp: bool = False
    """Frames end with a redundancy control trailer (IEC 62439-3), of LAN A."""
    phases: int = 3
    wave: Wave | None = None
    layout: str = "I4U4"
    dat_set: str | None = None
    refr_tm: bool = False
    smp_rate: bool = False
    smp_mod: int | None = None
    long_lengths: int = 0
    first_count: int = 0
    destination: bytes = DESTINATION
    source: bytes = SOURCE
    drift_ppm: float = 0.0
    conf_rev: int = 1
    smp_synch: int = 2
    simulate: bool = False
    quality: list[int] = field(default_factory=list)
    restarted_at: int = 0

    def __post_init__(self) -> None:
        self._check()
        self._columns = columns(self.layout)
        self._wave: Wave = SvWave(self.rate, self.phases) if self.wave is None else self.wave
        self.quality = self.quality or usual_quality(self._wave)
        self._link = Link(self.destination, self.source, self.vlan)
        size = len(self.frame(0)) - (0 if self.vlan is None else 4)
        if size > MAX_FRAME:
            raise ValueError(f"A frame would have {size} octets; Ethernet carries {MAX_FRAME}")

    def _check(self) -> None:
        if not 0x4000 <= self.appid <= 0x7FFF:
            raise ValueError(f"APPID {self.appid:#06x} is outside 0x4000..0x7FFF")
        if not 0 < self.rate <= 0xFFFF + 1 or self.asdus < 1:
            raise ValueError(
                f"{self.rate} samples/s with {self.asdus} a frame: smpCnt has 16 bits, a frame one ASDU or more"
            )
        if self.vlan is not None and not 0 <= self.vlan <= 0xFFF:
            raise ValueError(f"VLAN identifier {self.vlan} is outside 0..4095")

    @property
    def samples_per_frame(self) -> int:
        """ASDUs a frame."""
        return self.asdus

    def due_s(self, k: int) -> float:
        """Time since the start [s] at which frame `k` leaves, with the drift of the unit's clock.

        The drift changes the pace only: the waveform keeps its frequency relative to the sample number.
        """
        return k * self.asdus / (self.rate * (1 + self.drift_ppm * 1e-6))

    def smp_cnt(self, sample: int) -> int:
        """smpCnt of sample number `sample`."""
        return (sample - self.restarted_at + self.first_count) % self.rate

    def frame(self, k: int) -> bytes:
        """Frame number `k` since the start, with the samples `k` * `asdus` and following, as the state is now."""
        first = k * self.asdus
        samples = self._samples(first)
        asdus = [self._asdu(first + n, sample).encode(self.long_lengths) for n, sample in enumerate(samples)]
        frame = sv_frame(self._link, self.appid, sav_pdu(asdus, self.long_lengths), self.simulate)
        if not self.prp:
            return frame
        size = len(frame) - len(self._link.header()) + 6  # from the EtherType on, with the trailer
        return frame + struct.pack(">HHH", k & 0xFFFF, 0xA000 | size, 0x88FB)

    def set_quality(self, bits: int, channel: int | None = None) -> None:
        """Sets the quality word of channel 0..7, or of all channels."""
        for place in range(8) if channel is None else [channel]:
            self.quality[place] = bits

    def set_test(self, test: bool) -> None:
        """Sets or clears the quality bit test of all channels."""
        self.quality = [word | q.TEST if test else word & ~q.TEST for word in self.quality]

    def _samples(self, first: int) -> list[bytes]:
        """Contents of the element sample of each ASDU: pairs of INT32 and quality."""
        words = np.empty((self.asdus, len(self._columns), 2), dtype=">i4")
        words[:, :, 0] = self._wave.channels(first, self.asdus)[:, self._columns]
        words[:, :, 1] = np.array(self.quality, dtype=np.uint32).view(np.int32)[self._columns]
        return [asdu.tobytes() for asdu in words]

    def _asdu(self, number: int, sample: bytes) -> Asdu:
        return Asdu(
            self.svid,
            self.smp_cnt(number),
            self.conf_rev,
            self.smp_synch,
            sample,
            dat_set=self.dat_set,
            refr_tm=utc_time(EPOCH_S + number // self.rate, number % self.rate / self.rate) if self.refr_tm else None,
            smp_rate=self.rate if self.smp_rate else None,
            smp_mod=self.smp_mod,
        )


def columns(layout: str) -> list[int]:
    """Places in `wave.CHANNELS` of a layout such as "I4U4" or "I3U3". Raises ValueError for another form."""
    found = re.fullmatch(r"I([0-4])U([0-4])", layout)
    if found is None:
        raise ValueError(f"Layout {layout!r} is not of the form I4U4")
    return [*range(int(found[1])), *range(4, 4 + int(found[2]))]


def usual_quality(wave: Wave) -> list[int]:
    """Quality words of the 8 channels: good; invalid without a sensor; derived for a calculated neutral."""
    phase = [q.GOOD if place < wave.phases else q.INVALID_9_2LE for place in range(3)]
    neutral = q.DERIVED if wave.neutral_derived else q.GOOD
    return [*phase, neutral, *phase, neutral]
