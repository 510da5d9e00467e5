"""Meter of RMS values: slowly changing values around set points, in the registers of a real model."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping

from tests.doubles.modbus.bank import ILLEGAL_ADDRESS, ILLEGAL_FUNCTION, ILLEGAL_VALUE, ModbusFault
from tests.doubles.modbus.layouts import LAYOUTS, Field
from tests.doubles.modbus.wire import MOST_READ

_WIDEST_GAP = 40
"""Registers between two values that can be read as 0: makers reserve them. Wider gaps are illegal addresses."""
_PERIODS_S = (17.0, 23.0, 31.0)


def _readable(fields: tuple[Field, ...]) -> set[int]:
    """Addresses of the values and of the narrow gaps between them."""
    addresses: set[int] = set()
    end: int | None = None
    for field in sorted(fields, key=lambda each: each.address):
        if end is not None and field.address - end <= _WIDEST_GAP:
            addresses.update(range(end, field.address))
        end = field.address + field.count
        addresses.update(range(field.address, end))
    return addresses


class RmsMeter:
    """Bank of registers of a meter; `LAYOUTS` has the models.

    Voltage `Vrms` [V] and current `Irms` [A] of each phase swing by the share `swing` around the set point, phase by
    phase differently, and are measured anew each `refresh_s`. `lag` [rad] of the current, `f` [Hz], energies at the
    start [kWh]; a negative power counts as export. Variants: `swap_words` (the other order of words), `faulty`
    (address -> exception code of each read that touches it), `max_count` (registers that one read may have),
    `stale` (the registers no longer change). `clock` [s] is for tests.
    """

    def __init__(
        self,
        model: str,
        *,
        Vrms: float = 230.0,
        Irms: float = 2.0,
        lag: float = 0.4,
        f: float = 50.0,
        import_kwh: float = 1234.5,
        export_kwh: float = 6.7,
        swing: float = 0.005,
        refresh_s: float = 0.5,
        swap_words: bool = False,
        faulty: Mapping[int, int] | None = None,
        max_count: int = MOST_READ,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Raises ValueError for an unknown model."""
        if model not in LAYOUTS:
            raise ValueError(f"{model!r} is none of {', '.join(LAYOUTS)}")
        self.model = model
        self.layout = LAYOUTS[model]
        self.Vrms, self.Irms, self.lag, self.f = Vrms, Irms, lag, f
        self.import_kwh, self.export_kwh = import_kwh, export_kwh
        self.swing, self.refresh_s = swing, refresh_s
        self.swap_words = swap_words
        self.faulty = dict(faulty or {})
        self.max_count = max_count
        self.stale = False
        self._clock = clock
        self._since = self._measured = clock()
        self._readable = _readable(self.layout.fields)
        self._lock = threading.Lock()
        self._words: dict[int, int] = {}
        self._values: dict[str, float] = {}
        self._measure(0.0)

    def _phase(self, phase: int, t: float) -> dict[str, float]:
        angle = 2 * math.pi * t / _PERIODS_S[phase - 1] + phase
        U = self.Vrms * (1 + self.swing * math.sin(angle))
        I = self.Irms * (1 + self.swing * math.cos(2 * angle))  # noqa: E741
        PF = math.cos(self.lag)
        return {f"U{phase}": U, f"I{phase}": I, f"P{phase}": U * I * PF, f"S{phase}": U * I, f"PF{phase}": PF}

    def _exact(self, t: float) -> dict[str, float]:
        """Values at `t` [s] after the start."""
        values: dict[str, float] = {}
        for phase in (1, 2, 3):
            values.update(self._phase(phase, t))
        values["P"] = sum(values[f"P{phase}"] for phase in (1, 2, 3))
        values["S"] = sum(values[f"S{phase}"] for phase in (1, 2, 3))
        values["PF"] = values["P"] / values["S"] if values["S"] else 1.0
        values["f"] = self.f * (1 + 0.02 * self.swing * math.sin(t))
        values["import_kwh"] = self.import_kwh
        values["export_kwh"] = self.export_kwh
        return values

    def _measure(self, elapsed: float) -> None:
        """Set the registers anew and count the energy of the `elapsed` seconds."""
        exact = self._exact(self._measured - self._since)
        kwh = exact["P" if any(field.name == "P2" for field in self.layout.fields) else "P1"] * elapsed / 3.6e6
        self.import_kwh += max(kwh, 0.0)
        self.export_kwh += max(-kwh, 0.0)
        exact["import_kwh"], exact["export_kwh"] = self.import_kwh, self.export_kwh
        for field in self.layout.fields:
            words = field.encode(exact[field.name])
            self._values[field.name] = field.decode(words)
            ordered = words[::-1] if self.layout.low_word_first != self.swap_words else words
            self._words.update(enumerate(ordered, field.address))

    def _refresh(self) -> None:
        now = self._clock()
        if not self.stale and now - self._measured >= self.refresh_s:
            elapsed, self._measured = now - self._measured, now
            self._measure(elapsed)

    @property
    def values(self) -> dict[str, float]:
        """What the registers say now, after their rounding, in V, A, W, VA, Hz and kWh: the model's quantities only."""
        with self._lock:
            self._refresh()
            return dict(self._values)

    def _check(self, function: int, address: int, count: int) -> None:
        if function not in self.layout.functions:
            raise ModbusFault(ILLEGAL_FUNCTION)
        if count > self.max_count:
            raise ModbusFault(ILLEGAL_VALUE)
        asked = range(address, address + count)
        for at in self.faulty.keys() & set(asked):
            raise ModbusFault(self.faulty[at])
        if not self._readable.issuperset(asked):
            raise ModbusFault(ILLEGAL_ADDRESS)

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Registers of one instant. Raises ModbusFault: 1 for the other table, 2 outside, 3 above `max_count`."""
        self._check(function, address, count)
        if count == 1 and address in (alone := dict(self.layout.alone)):
            return [alone[address]]
        with self._lock:
            self._refresh()
            return [self._words.get(at, 0) for at in range(address, address + count)]
