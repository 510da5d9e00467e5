"""Every round of a meter is judged, as long as it is read: what is no measurement becomes null, and the row says so.

A meter that boots answers with zeros, one behind a broken gateway with all bits high, a display that overflows with its
largest number. Such rounds come at any time, and one of them among good ones would be a fall of the energy by all that
was counted. Values are never corrected; only the energy of a meter that has been exchanged or reset is continued.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from acqd.sources.meters.counter import CONFIRM_NS, CONFIRM_ROUNDS, INVALID, Counter
from acqd.sources.meters.decode import raw_value
from acqd.sources.meters.lone import alone
from acqd.sources.meters.plan import Plan
from acqd.sources.meters.profile import Profile
from acqd.sources.meters.resolution import Resolution

_VOLTS = 2.0
"""Of the nominal voltage: no supply holds more for a second (EN 50160: swells below 1.2 kV stay under 1.7)."""
_TINY_V = 1e-3
"""No meter resolves less, and a dead phase reads 0 or some volts."""
_EXCHANGED = (2e-41, 8e-41)
"""Of any unit: what floats of up to seven bits, such as 2.0 and 414.0, become where the halves of their registers are
exchanged. Other tiny numbers are no fault: the filters of a meter at rest end at some 1e-44."""
_HERTZ = (40.0, 70.0)
_PF = 1.05
_PF_BELOW = 0.15
"""How far |PF| may be below |P| / S; above it a meter may show the one of the fundamentals (IEC 61557-12)."""
_PF_ABOVE = 4.0
"""How many times |PF| may be above |P| / S: that of the fundamentals is, by sqrt(1 + THD^2) of the current, and no load
has a THD of 380 %."""
_PARTS = 0.3
"""Share of the sum of S by which the total of P may differ from the phases: registers of a round differ in time; half
of it where one answer holds them all."""
_DEAD = 0.05
"""Of the nominal voltage: below it there are no mains, and no f."""
_SLACK = 0.1  # share of V x I by which P and S may be larger: resolution, and times that differ
_SMALL_VA = 25.0  # below this the meters' resolution says more than the load
_LARGEST = 1e10  # A, W, VA or kWh: floats that mean nothing are larger
_CARRIES, _LEAST_A = 0.05, 0.1
"""Share of the largest current, and amperes, that are no noise."""
_FEW = 6  # registers of a round that may all be zero by chance
_CHANNELS = ("L1", "L2", "L3", "total")
_RECENT_NS = 60_000_000_000
"""Values of longer ago say nothing of those of now."""


@dataclass(slots=True)
class Judged:
    """A round after judgement."""

    values: dict[str, float | None]
    flags: frozenset[str]


@dataclass(slots=True)
class RoundJudge:
    """Judges the rounds of one meter in turn."""

    nominal_voltage: float
    one_moment: bool = False
    """P of the phases and of the total are of one answer."""
    _counters: dict[str, Counter] = field(default_factory=dict)
    _most_VA: float = 0.0
    _believed: dict[str, float] = field(default_factory=dict)
    """Values of the last round in which nothing was contradicted."""
    _resolutions: dict[str, Resolution] = field(default_factory=dict)
    _round_ns: int = 0
    _f_alone: tuple[int, int] | None = None
    """Since when, and in how many rounds, f alone has left its value."""

    def blank(self, profile: Profile, plan: Plan, answers: list[bytes]) -> bool:
        """Whether the registers hold nothing: all of them zero (a meter that boots), or most with all bits high."""
        raw = [(raw_value(one, plan.bytes_of(one, answers)), one.width) for one in profile.quantities.values()]
        high = sum(value == (1 << 16 * width) - 1 for value, width in raw)
        return (len(raw) >= _FEW and not any(value for value, _ in raw)) or 2 * high > len(raw)

    def expect(self, values: dict[str, float | None]) -> None:
        """A round that makes no row: the first energies of `judge` have to follow its own."""
        for name, value in values.items():
            if name.endswith((".W", ".W_export")) and value is not None:
                self._counters.setdefault(name, Counter()).first = value

    @property
    def too_fast(self) -> bool:
        """Whether an energy rises faster than any load at these voltages and currents makes it."""
        return any(counter.too_fast for counter in self._counters.values())

    def contradicts(self, values: dict[str, float | None], now_ns: int) -> bool:
        """Whether powers, voltages and currents cannot be of the same moment: another read may agree."""
        known = dict(values)
        self._drop_contradicting(known)
        return known != values or bool(self._alone(values, now_ns))

    def judge(self, values: dict[str, float | None], now_ns: int) -> Judged:
        """The values that may be measurements. A contradiction makes the contradicting ones null."""
        known = dict(values)
        for name, value in values.items():
            if value is not None and self._impossible(name, value):
                known[name] = None
            elif value is not None:
                self._resolutions.setdefault(name, Resolution()).feed(value)
        voltages = [name for name in values if name.endswith(".Vrms") and values[name] is not None]
        if voltages and all(known[name] is None for name in voltages):  # another word order, another device: no energy
            return Judged(dict.fromkeys(values), frozenset({INVALID}))
        lone = self._alone(known, now_ns)
        if not self._lasting(lone, now_ns):
            known |= dict.fromkeys(lone)
        self._drop_contradicting(known)
        if known == values:
            self._believed = {name: value for name, value in known.items() if value is not None}
        self._round_ns = now_ns
        flags = {INVALID} if known != values else set()
        alive = max(known.get(f"L{k}.Vrms") or 0.0 for k in (1, 2, 3)) > _DEAD * self.nominal_voltage
        if known.get("f") == 0 and alive:
            known["f"] = None  # a meter that does not measure f
        self._most_VA = max(self._most_VA, _largest_power(known))
        for name in known:
            if name.endswith((".W", ".W_export")):
                known[name] = self._counted(name, known[name], now_ns, flags)
        return Judged(known, frozenset(flags))

    def _drop_contradicting(self, known: dict[str, float | None]) -> None:
        _drop_dead_voltages(known, _DEAD * self.nominal_voltage)
        for channel in _CHANNELS:
            _drop_powers(channel, known, _DEAD * self.nominal_voltage)
            _drop_power_factor(channel, known)
        _drop_total(known, _PARTS / 2 if self.one_moment else _PARTS)

    def _impossible(self, name: str, value: float) -> bool:
        kind = name.rpartition(".")[2]
        if _EXCHANGED[0] < abs(value) < _EXCHANGED[1]:
            return True
        if kind == "Vrms":
            tiny = 0 < abs(value) < _TINY_V  # half of the bits of a number, in the wrong place
            return tiny or not -1e-9 <= value <= _VOLTS * self.nominal_voltage
        if kind == "f":
            return value != 0 and not _HERTZ[0] <= value <= _HERTZ[1]
        if kind == "PF":
            return abs(value) > _PF
        return abs(value) > _LARGEST or (kind in ("W", "W_export", "Irms") and value < -1e-3)

    def _alone(self, known: dict[str, float | None], now_ns: int) -> set[str]:
        """Registers that have left the others since the last round."""
        if now_ns - self._round_ns > _RECENT_NS:
            self._believed.clear()
        steps = {name: resolution.step for name, resolution in self._resolutions.items()}
        return alone(self._believed, known, self.nominal_voltage, steps)

    def _lasting(self, lone: set[str], now_ns: int) -> bool:
        """Whether f alone has left its value for long: it is that of another supply then."""
        if lone != {"f"}:
            self._f_alone = None
            return False
        since, rounds = self._f_alone or (now_ns, 0)
        self._f_alone = (since, rounds + 1)
        return now_ns - since >= CONFIRM_NS and rounds >= CONFIRM_ROUNDS

    def _counted(self, name: str, value: float | None, now_ns: int, flags: set[str]) -> float | None:
        """The energy that a register stands for; null while it is in doubt."""
        counter = self._counters.setdefault(name, Counter())
        if value is None:
            return None
        return counter.feed(value, now_ns, self._most_VA, may_be_zero=name != "total.W", flags=flags)


def _largest_power(known: dict[str, float | None]) -> float:
    """Largest apparent power of a phase or of the total [VA]; a meter may have P of the total alone."""
    powers = [abs(known.get(f"{channel}.{kind}") or 0.0) for channel in _CHANNELS for kind in ("P", "S")]
    return max(*powers, *(_product(f"L{k}", known) or 0.0 for k in (1, 2, 3)))


def _drop_power_factor(channel: str, known: dict[str, float | None]) -> None:
    """|PF| is not below |P| / S, and not many times above it: then nobody knows whether P or PF is wrong.

    Of a phase without S, V x I stands for it, which may be what is wrong.
    """
    P, S, PF = (known.get(f"{channel}.{name}") for name in ("P", "S", "PF"))
    doubtful = ["P", "PF"]
    if f"{channel}.S" not in known and channel != "total":
        S, doubtful = _product(channel, known), ["P", "PF", "Irms"]
    if P is None or PF is None or S is None or abs(S) < 4 * _SMALL_VA:
        return
    if abs(PF) < abs(P / S) - _PF_BELOW:
        known[f"{channel}.PF"] = None
    elif abs(PF) > _PF_BELOW and abs(PF) > _PF_ABOVE * abs(P / S):
        known |= {f"{channel}.{name}": None for name in doubtful}


def _drop_total(known: dict[str, float | None], most_apart: float) -> None:
    """The total of P is the sum of the phases, and not above the total of S.

    `most_apart`: share of V x I by which it may differ. Phases without another witness of P are as doubtful as it.
    """
    phases = [f"L{k}" for k in (1, 2, 3) if f"L{k}.Vrms" in known]
    P, VA = [known.get(f"{name}.P") for name in phases], [_product(name, known) for name in phases]
    total, S = known.get("total.P"), known.get("total.S")
    if len(phases) > 1 and total is not None and None not in P and None not in VA:
        apart = abs(total - sum(p for p in P if p is not None))
        if apart > most_apart * sum(va for va in VA if va is not None) + 4 * _SMALL_VA:
            alone = [name for name in phases if f"{name}.S" not in known and f"{name}.PF" not in known]
            known |= {f"{name}.P": None for name in ("total", *alone)}
            return
    if total is not None and S is not None and _above(abs(total), abs(S)):
        known["total.S"] = None


def _drop_dead_voltages(known: dict[str, float | None], dead_V: float) -> None:
    """A phase without voltage carries no current while others live: the fuse of its measuring input has gone."""
    phases = [f"L{k}" for k in (1, 2, 3) if known.get(f"L{k}.Vrms") is not None]
    largest = max((known.get(f"{name}.Irms") or 0.0 for name in phases), default=0.0)
    if not any((known[f"{name}.Vrms"] or 0.0) > dead_V for name in phases):
        return
    for name in phases:
        current = known.get(f"{name}.Irms") or 0.0
        if (known[f"{name}.Vrms"] or 0.0) <= dead_V and current > max(_CARRIES * largest, _LEAST_A):
            known[f"{name}.Vrms"] = None
            known |= {key: None for key in (f"{name}.P", f"{name}.S") if known.get(key) == 0}


def _drop_powers(channel: str, known: dict[str, float | None], dead_V: float) -> None:
    """|P| and S are at most V x I, and |P| at most S: the value that stands alone becomes null."""
    product, S = _product(channel, known), known.get(f"{channel}.S")
    P = known.get(f"{channel}.P")
    S = None if S is None else abs(S)
    if P is not None and product is not None and _above(abs(P), product):
        if S is not None and not _above(abs(P), S) and channel != "total":
            volts = known[f"{channel}.Vrms"] or 0.0
            known[f"{channel}.{'Irms' if volts > dead_V else 'Vrms'}"] = None  # P and S agree
            return
        known[f"{channel}.P"] = P = None
    if S is not None and product is not None and _above(S, product):
        known[f"{channel}.S"] = S = None
    if channel != "total" and S and product is not None and product > _PF_ABOVE * S + 4 * _SMALL_VA:
        known[f"{channel}.Irms"] = None  # more than any distortion makes of V x I
    if P is not None and S is not None and channel != "total" and _above(abs(P), S):
        known[f"{channel}.P"] = None


def _above(value: float, limit: float) -> bool:
    return value > (1 + _SLACK) * limit + _SMALL_VA


def _product(channel: str, values: dict[str, float | None]) -> float | None:
    """V x I [VA]; of the total, the sum of the phases; None where a factor is not known."""
    if channel == "total":
        parts = [_product(f"L{k}", values) for k in (1, 2, 3) if f"L{k}.Vrms" in values]
        return None if not parts or None in parts else sum(part for part in parts if part is not None)
    volts, amperes = values.get(f"{channel}.Vrms"), values.get(f"{channel}.Irms")
    return None if volts is None or amperes is None else volts * amperes
