"""Units of voltages, currents and times as files write them.

A table and not a library of units: a header holds one of three dimensions with an SI prefix, in one of the spellings
below, and what matters is to refuse all others (ADR 33).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from acqd.sources.recording.label import readings, says_a_quantity_alone

Quantity = Literal["u", "i", "t", ""]
"""Voltage, current, time; empty: another quantity, or none that is known."""
WORDS = {"u": "V", "i": "A", "t": "s"}
"""SI unit of a quantity."""
_PREFIX = {"": 1.0, "k": 1e3, "K": 1e3, "M": 1e6, "m": 1e-3, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "n": 1e-9, "p": 1e-12}
_NAMED_PREFIX = {"kilo": 1e3, "mega": 1e6, "milli": 1e-3, "micro": 1e-6, "nano": 1e-9, "pico": 1e-12}
_SYMBOL: dict[str, Quantity] = {"V": "u", "v": "u", "A": "i", "a": "i", "s": "t", "S": "t"}
_NAME: dict[str, Quantity] = {
    **dict.fromkeys(("volt", "volts", "vac", "v ac"), "u"),
    **dict.fromkeys(("amp", "amps", "ampere", "amperes", "ampère", "ampères", "aac", "a ac"), "i"),
    **dict.fromkeys(("sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden", "seconde", "secondes"), "t"),
}
_CYRILLIC = str.maketrans("ВАскмн", "VAskmn")
"""Letters of Russian units: кВ, мА, мкс."""
_OTHER_TIMES = {"min": 60.0, "minute": 60.0, "minutes": 60.0, "h": 3600.0, "hour": 3600.0, "hours": 3600.0}
_OTHER_WORDS = """
    w kw mw gw var kvar mvar va kva mva hz khz mhz rpm nm n pa bar °c c degc k °f deg ° rad % pu p.u. ohm kohm Ω t mt
    wh kwh mwh varh kvarh vah kvah j kj kg mm m cm db dbv dbm bit bool
"""
_OTHER = frozenset(_OTHER_WORDS.split())
_OTHER_TAILS = frozenset(("va", "kva", "var", "kvar", "w", "kw", "hz", "khz", "pu", "p.u.", "%"))
"""Those that are units also behind a name without brackets: `u1_pu`."""
TIME_NAMES = ("time", "t", "zeit", "temps", "tiempo", "tempo", "x", "x-axis", "time axis", "timestamp", "seconds")
"""Names of a time column."""
CLOCK_NAMES = {"millis": 1e-3, "micros": 1e-6}
"""Clocks of microcontrollers that name a time column, and seconds per unit."""
_NONE = frozenset(("", "-", "--", "none", "n/a", "na", "1", "x", "?"))


@dataclass(frozen=True, slots=True)
class Unit:
    """What one number of a channel is worth."""

    quantity: Quantity
    factor: float
    """SI units (V, A, s) per unit of the file."""


class UnknownUnitError(ValueError):
    """A text that is no unit of the table, or means more than one; the message says which."""


def unit_of(text: str) -> Unit | None:
    """The unit in `text`; None where there is none. Units of power, temperature ... have the quantity "".

    Raises UnknownUnitError for anything else, and for `MA`, `MV`, `mv` ..., which may be milli and mega.
    """
    plain = text.strip().strip("[](){}<>").strip()
    if plain.lower() in _NONE:
        return None
    if plain in ("MV", "MA", "mv", "ma"):
        return _milli_or_mega(plain)
    if plain.lower() in _OTHER_TIMES:
        return Unit("t", _OTHER_TIMES[plain.lower()])
    found = _symbol(plain) or _name(plain.lower()) or _symbol(plain.replace("мк", "µ").translate(_CYRILLIC))
    if found is not None:
        return found
    if plain.lower() in _OTHER:
        return Unit("", 1.0)
    raise UnknownUnitError(f"unit {plain!r} is unknown; expected V, kV, mV, A, kA, mA, s, ms, us ...")


def _milli_or_mega(plain: str) -> Unit:
    """In lower case the prefix is milli, as in every file that writes so; capitals may be either."""
    if plain.islower():
        return Unit(_SYMBOL[plain[1]], 1e-3)
    small = f"m{plain[1]}"
    raise UnknownUnitError(f"unit {plain!r} is {small} or mega-{plain[1]}; write {small}, or say the scale")


def _symbol(plain: str) -> Unit | None:
    """`kV`, `mA`, `us`; with a power of ten as an instrument's scale: `10V`, `1e-3 V`."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)?\s*([kKMmµμunp]?)([VvAasS])", plain)
    if match is None:
        return None
    number, prefix, symbol = match.groups()
    quantity = _SYMBOL[symbol]
    if quantity == "t" and prefix in ("k", "K"):
        return None
    if quantity == "t" and prefix == "M":  # a header in capitals: nobody samples in megaseconds
        prefix = "m"
    if not prefix and symbol == "S" and number is None:
        return Unit("t", 1.0)
    return Unit(quantity, float(number or 1.0) * _PREFIX[prefix])


def _name(lower: str) -> Unit | None:
    if lower in ("us", "ms", "ns", "ps"):
        return Unit("t", _PREFIX[lower[0]])
    if lower in ("kv", "ka"):
        return Unit(_SYMBOL[lower[1]], 1e3)
    for prefix, factor in (("", 1.0), *_NAMED_PREFIX.items()):
        rest = lower.removeprefix(prefix)
        if lower.startswith(prefix) and rest in _NAME:
            return Unit(_NAME[rest], factor)
    for letter, factor in (("m", 1e-3), ("k", 1e3), ("µ", 1e-6), ("u", 1e-6)):
        if lower.startswith(letter) and lower[1:] in _NAME:  # mVolt, kVolts, msec
            return Unit(_NAME[lower[1:]], factor)
    return None


_BRACKETS = re.compile(r"^(.*?)\s*[\[\(\{<]\s*([^\[\]\(\)\{\}<>]*?)\s*[\]\)\}>]\s*$")
_GLUED = re.compile(r"^(?P<name>(?i:ch(?:annel)?\s?\d+))(?P<unit>[VA])$|"
                    r"^(?P<stem>.*[A-Za-z0-9])(?P<small>(?<=\d)[uµμ][VA]|[mk][VA])$")  # fmt: skip
"""`CH1V` of Rigol; `U1mV`, but not `UA`: a prefix tells a unit from a phase."""
_TAIL = re.compile(r"^(.+?)(\s+in\s+|\s*/\s*|\s*,\s*|_|\s+)([^\s_/,]+)$", re.IGNORECASE)


def split_label(label: str, labels: Iterable[str] = ()) -> tuple[str, str]:
    """Name and unit of a header such as `u1 [kV]`, `Time (s)`, `U1/V`, `i1 in mA`, `t_ms`; the unit may be "".

    A tail without brackets is a unit only if the table has it: `I_A` is the current of phase A, `i1_A` a current in A,
    `U_S` the voltage of phase S, `t_s` a time in s, `u_v` beside `u_u` and `u_w` that of phase V.
    `U / A` is a voltage of phase A and `I / A` a current in A, unless one of the `labels` beside it is `I / B`.
    """
    text = label.strip().strip('"').strip()
    found = _BRACKETS.match(text)
    if factor := _factor(text if found is None else found.group(1)):
        return text, factor  # no unit, so it is refused: the numbers may be multiplied already, or not
    if found and found.group(2):
        inner = found.group(2)
        if _is_unit(inner) or (_looks_like_unit(inner) and not _of_spice(text, labels)):
            return found.group(1).strip() or text, inner
        return text, ""
    if alone := _unit_alone(text):
        return text, alone
    if glued := _GLUED.match(text):
        return glued["name"] or glued["stem"], glued["unit"] or glued["small"]
    if sensitivity := _SENSITIVITY.search(text):
        return text, sensitivity[1]  # of a probe: the numbers may be its volts, or amperes
    tail = _TAIL.match(text)
    if tail and _is_unit(tail.group(3)):
        stem, between, last = tail.group(1).strip(), tail.group(2).strip().lower(), tail.group(3)
        machine = last in ("V", "v", "W", "w") and says_a_quantity_alone(stem) and _has_sibling(text, labels)
        phase = between != "in" and (_is_phase(tail.group(1), last) or machine)
        if phase and between in ("/", ","):  # I / A, as ISO 80000-1 writes it
            phase = any(one.quantity == "u" for one in readings(stem)) or _has_sibling(text, labels)
        if not phase:
            return stem, last
    return text, ""


def _unit_alone(label: str) -> str:
    """The unit in a name that is nothing else: `in kV`, `Volts`, `Milliamps`; of letters alone, A may be a phase."""
    found = re.fullmatch(r"(?i)(in\s+)?(\S+)", label)
    if found is None or not (_is_unit(found[2]) if found[1] else len(label) > 2 and _name(label.lower())):
        return ""
    return found[2]


_SENSITIVITY = re.compile(
    r"(?<![A-Za-z])((?:\d+(?:[.,]\d+)?\s*[mkµμu]?|[mkµμu])V\s?/\s?[mk]?[AV]|\d+\s*[mk]?A\s?/\s?m?V)(?![A-Za-z])"
)
"""Of a probe, `100 mV/A`; `V / A` is a voltage of phase A."""
_FACTOR = re.compile(
    r"(?:^|[\w\s)\]])[\s_(\[]*([*x×/]\s?(\d+(?:[.,]\d+)?)|(?<=[\s_(\[])(\d+)\s?[x×*])\s*[)\]]?(?:[\s_(\[]|$)"
)
_CODES = re.compile(r"(?i)(?:^|[\W_])(raw|adc|counts?|lsb|digits?|codes?)(?:$|[\W_])")


def _factor(label: str) -> str:
    """A factor in a name, such as `u1 x10`, `u1*1000`, `u1_x100 (V)`; empty for a factor of 1."""
    found = _FACTOR.search(label)
    if found is None or (found.group(1)[0] == "x" and found.start(1) and label[found.start(1) - 1].isalnum()):
        return ""
    number = float((found.group(2) or found.group(3)).replace(",", "."))
    return "" if number == 1 else found.group(1)


def codes_word(name: str) -> str:
    """The word of a name that says that its numbers are codes of a converter (`adc_u1`, `u1_raw`); else empty."""
    found = _CODES.search(name)
    return found.group(1) if found else ""


def _is_unit(text: str) -> bool:
    try:
        unit = unit_of(text)
    except UnknownUnitError:
        return text in ("MV", "MA")  # known to be doubtful: the reader refuses it
    return unit is not None and (unit.quantity != "" or text.lower() in _OTHER_TAILS)


_NODE = re.compile(
    r"[VI]\((?!.*(?:[va]|volts?|amp\w*|rms|pu|raw|counts?|codes?|digits?|lsb)\))[a-z_][\w.:#,]*\)", re.IGNORECASE
)
"""`V(l1,n)` of two nodes, `I(Rload)` of a device, as SPICE writes them; `V(dBV)` is a unit."""


def _of_spice(label: str, labels: Iterable[str]) -> bool:
    """Whether brackets hold nodes and devices: all columns beside the time have them, and each its own."""
    others = [one for one in labels if one.strip().lower() not in TIME_NAMES]
    return label in others and len(set(others)) == len(others) > 1 and all(map(_NODE.fullmatch, others))


def _looks_like_unit(text: str) -> bool:
    """A text in brackets that stands for a unit, known or not: `[bar]`, `[pu]`, `[Gauss]`; `(L1)`, `(CT 2)` do not."""
    if re.fullmatch(r"[*x×]\s?[\d.,]+|[\d.,]+\s?[*x×]", text):
        return True
    if re.search(r"[\d.]\s*[*x×/^]|[*x×/]\s*[\d.]|^[x×*]", text) and re.search(r"(?i)[va]", text):
        return True  # a scale beside a unit, `x100 V`, `V/10`: the reader refuses it
    if "%" in text:
        return True
    if re.search(r"(?i)[va]\b.*(@|\bohms?\b|Ω|\bshunt\b)", text):
        return True  # of a resistor: `V @ 0.1 Ohm`
    if re.search(r"\s|\d$", text):
        return False
    return re.fullmatch(r"(?i)[lnabcrst]|[a-c][a-cn]|[cvpt][tc]|ph.*|ch.*|rms.*|ac|dc|raw", text) is None


def _is_phase(stem: str, tail: str) -> bool:
    """Whether a single letter after a quantity that has no phase yet names the phase: `I_A`, `Voltage A`, `U_S`."""
    if tail in ("s", "S"):
        return stem.lower() not in TIME_NAMES
    return tail in ("A", "a") and not re.search(r"\d$|[\d_ -][a-cr-tA-CR-T]$|^[uviUVI][a-cr-tA-CR-T]$", stem)


def _has_sibling(label: str, labels: Iterable[str]) -> bool:
    """Whether another label differs by the letter of another phase only: `Current/A` beside `Current/B`."""
    others = {"A": "BC", "a": "bc", "S": "RT", "s": "rt", "V": "UW", "v": "uw", "W": "UV", "w": "uv"}.get(label[-1], "")
    return not {label[:-1] + other for other in others}.isdisjoint(one.strip().strip('"').strip() for one in labels)
