"""A simulated three-phase connection behind an EL3783; every row it leads to is flagged `simulated`."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.block import CODE_MAX, CODE_MIN, Codes, nominal_near
from acqd.sources import el3783
from acqd.sources.base import Source

_CHUNK_S = 0.04  # computed at once; noise is seeded per chunk, so reads of any size see the same stream


@dataclass(frozen=True, slots=True)
class Sag:
    """A voltage dip (or, with depth 1, an interruption)."""

    at: float
    """Start [s] after the stream's."""
    duration: float
    """[s]."""
    depth: float
    """Share of the voltage that is missing, 0 .. 1."""


@dataclass(frozen=True, slots=True)
class SimulationSettings:
    """What the simulated mains and load look like."""

    phases: int = 3
    seed: int = 1
    rate: float = el3783.RATE
    """Samples/s."""
    voltage: float = 230.0
    """Vrms of the fundamental [V]."""
    frequency: float = 50.0
    """Mean mains frequency [Hz]."""
    frequency_drift: float = 0.0
    """Steady drift [Hz/s]."""
    frequency_wander: float = 0.02
    """Amplitude of a slow sinusoidal wander [Hz]."""
    wander_period: float = 60.0
    """[s]."""
    harmonics: dict[int, float] = field(default_factory=lambda: {3: 0.01, 5: 0.02, 7: 0.01})
    """Voltage harmonics: order -> share of the fundamental."""
    current_harmonics: dict[int, float] = field(default_factory=lambda: {3: 0.15, 5: 0.08, 7: 0.04})
    noise: float = 0.0005
    """RMS noise of voltage and current, share of the fundamental."""
    dc: float = 0.0
    """DC offset of the voltage, share of the fundamental."""
    power: float = 180.0
    """Active power per phase [W] when there is no load profile."""
    power_factor: float = 0.9
    """Displacement factor of the load, inductive."""
    load_profile: Path | None = None
    """CSV `t,P1[,P2,P3]` [s, W], linear in between, repeated when it ends."""
    sags: tuple[Sag, ...] = ()
    current_range: el3783.CurrentRange = 5
    """EL3783 range [A]."""


class SimulatedSource(Source):
    """Seeded and reproducible: the same settings give the same codes, however they are read."""

    flags = frozenset({"simulated"})

    def __init__(self, settings: SimulationSettings | None = None) -> None:
        self.settings = settings or SimulationSettings()
        s = self.settings
        self.form = StreamFormat(
            s.rate,
            (el3783.U_V_PER_DIGIT, el3783.I_A_PER_DIGIT[s.current_range]) * s.phases,
            nominal_near(s.frequency),
        )
        self._profile = _read_profile(s.load_profile, s.phases) if s.load_profile else None
        self._size = round(_CHUNK_S * s.rate)
        self._chunk: tuple[int, Codes] = (-1, np.empty((0, 2 * s.phases), dtype=np.int16))
        self._orders = max([1, *s.harmonics, *s.current_harmonics])
        self._weights = self._channel_weights()
        self._utc = 0
        self._base = 0
        self._position = 0

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Begin at `index`; the waveform at a sample number is always the same."""
        self._utc, self._base, self._position = utc_ns, index, 0

    def read(self, limit: int) -> SampleBlock | None:
        """The next `limit` samples: there are always more."""
        at = self._base + self._position
        utc = self._utc + round(self._position * 1e9 / self.form.rate)
        self._position += limit
        codes = self._part(at, limit)
        while len(codes) < limit:
            codes = np.concatenate((codes, self._part(at + len(codes), limit - len(codes))))
        return SampleBlock(codes, at, utc, 0, self.flags)

    def ahead(self, limit: int) -> Codes:
        """Up to the end of what is computed."""
        return self._part(self._base + self._position, limit)

    def skip(self, count: int) -> None:
        """Nothing to compute for samples that nobody wants."""
        self._position += count

    def _part(self, at: int, limit: int) -> Codes:
        """At most `limit` samples from `at` on, as far as its chunk goes."""
        number, offset = divmod(at, self._size)
        if self._chunk[0] != number:
            self._chunk = (number, self._compute(number))
        return self._chunk[1][offset : offset + limit]

    def _compute(self, number: int) -> Codes:
        s = self.settings
        t = (number * self._size + np.arange(self._size)) / s.rate
        turns = s.frequency * t + s.frequency_drift * t * t / 2
        slow = 2 * np.pi / s.wander_period
        turns = turns + s.frequency_wander / slow * (1 - np.cos(slow * t))
        factor = np.ones_like(t)
        for sag in s.sags:
            factor[(t >= sag.at) & (t < sag.at + sag.duration)] = 1 - sag.depth
        random = np.random.default_rng((s.seed, number))
        noise = s.noise * random.standard_normal((2 * s.phases, self._size))
        turn = np.exp(2j * np.pi * (turns % 1.0))
        powers = [turn]
        for _ in range(self._orders - 1):
            powers.append(powers[-1] * turn)
        waves = (self._weights @ np.array(powers)).real
        ampere = self._power(t) / (s.voltage * max(s.power_factor, 0.01))
        waves[0::2] = s.voltage * (factor * waves[0::2] + s.dc + noise[0::2])
        waves[1::2] = ampere * (factor * waves[1::2] + noise[1::2])
        digits = np.rint(waves * (np.sqrt(2) / np.array(self.form.scale))[:, None])
        return np.ascontiguousarray(np.clip(digits, CODE_MIN, CODE_MAX).T).astype(np.int16)

    def _channel_weights(self) -> np.ndarray:
        """[channels, orders] complex amplitude of each harmonic, in shares of the fundamental."""
        s = self.settings
        random = np.random.default_rng(s.seed)
        angles = {h: random.uniform(0, 2 * np.pi) for h in sorted({*s.harmonics, *s.current_harmonics})}
        lag = float(np.arccos(np.clip(s.power_factor, 0.0, 1.0)))
        weights = np.zeros((2 * s.phases, self._orders), dtype=complex)
        for channel in range(2 * s.phases):
            shift = 2 * np.pi * (channel // 2) / 3 + (lag if channel % 2 else 0.0)
            shares = s.current_harmonics if channel % 2 else s.harmonics
            for order, share in {1: 1.0, **shares}.items():
                angle = angles[order] if order > 1 else 0.0
                weights[channel, order - 1] = share * np.exp(1j * (angle - order * shift))
        return weights

    def _power(self, t: Floats) -> Floats:
        """[phases, samples] W."""
        if self._profile is None:
            return np.full((self.settings.phases, len(t)), self.settings.power)
        times, powers = self._profile
        wrapped = times[0] + (t % (times[-1] - times[0]))
        return np.array([np.interp(wrapped, times, column) for column in powers])


def _read_profile(path: Path, phases: int) -> tuple[Floats, Floats]:
    """Times [rows] and powers [phases, rows] of a load profile. Raises InputError."""
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(path, f"load profile cannot be read ({error})") from None
    if not rows or [name.strip() for name in rows[0][:2]] != ["t", "P1"]:
        raise InputError(path, "load profile needs a header t,P1[,P2,P3] (seconds, watts)")
    table = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            table.append([float(text) for text in row])
        except ValueError:
            raise InputError(path, f"row {number}: {row} is not numbers") from None
        if len(row) != len(rows[0]):
            raise InputError(path, f"row {number} has {len(row)} columns, expected {len(rows[0])}")
    data = np.array(table)
    if len(data) < 2 or not np.isfinite(data).all() or (np.diff(data[:, 0]) <= 0).any():
        raise InputError(path, "load profile needs two rows or more, finite, with rising t")
    powers = data[:, 1:].T
    return data[:, 0], np.array([powers[min(phase, len(powers) - 1)] for phase in range(phases)])
