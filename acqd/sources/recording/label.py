"""What the name of a channel may mean: quantity, phase, feeder; every reading that its letters allow.

Phases are named A B C, 1 2 3 (L1 L2 L3), R S T, R Y B or U V W; two of one family are a voltage between phases. A
letter means one thing beside its family and another one alone: S is the second of R S T, and the synchronising voltage
beside A B C. So a name has several readings, and `roles` chooses among them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from acqd.sources.recording.channel import UNKNOWN, Kind, Letter

FAMILIES = {"abc": "abc", "123": "123", "rst": "rst", "ryb": "ryb", "uvw": "uvw"}
"""Letters of the phases L1, L2, L3."""
AMPERES = "amperes"
"""Family of A1 A2 A3, the currents of Chauvin Arnoux, which are inputs of others where one of them is missing."""


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_QUANTITY: dict[str, Letter] = {
    **dict.fromkeys(("u", "v", "voltage", "volt", "volts", "spannung", "tension", "tensione", "voltaje", "ugrid"), "u"),
    **dict.fromkeys(
        ("i", "current", "curr", "amp", "amps", "ampere", "strom", "courant", "corriente", "corrente"), "i"
    ),
}
_WORD_QUANTITY = sorted((word for word in _QUANTITY if len(word) > 2), key=len, reverse=True)
_FILLER = _set(
    "phase ph line ac inst instantaneous wave waveform raw primary pri secondary sec signal mains grid input analog "
    "channel of the to value load supply leiter aussenleiter phasen netz"
)
_COMPUTED = _set(
    "rms mag magnitude angle ang phasor freq frequency power thd avg mean average max min peak crest harmonic "
    "harmonics ref reference setpoint set cos phi fundamental fund effektiv rocof demand eff diff idiff bias ibias "
    "restraint alpha beta ualpha ubeta valpha vbeta ialpha ibeta ud uq vd vq id iq"
)
_OTHER = _set("temp temperature speed torque energy trigger position pressure digital time")
_DC = re.compile(r"^(?:[uvi]?dc\w*|\w*dc|batt?(?:ery)?\d*|[uv]bat\w*|dclink|zk|[uv]zk|zwischenkreis|station)$")
_SYNC = re.compile(r"^[uv]?(?:sync\w*|syn|synch\w*)\d*$")
_RESIDUAL = re.compile(
    r"^(?:3[uvi][0o]?|[uvi](?:n|ne|ng|e|g|gnd|pe|o|0|res\w*|resid\w*|earth|sum|neut\w*|ef|sef)\d?"
    r"|neut\w*|neutr\w*|homopol\w*|res|resid\w*|earth|ground|gnd|erde|sef|n|pe|zero|sum|summe|nul\w*)$"
)
_BETWEEN = re.compile(r"^([uv]?(ll|ltl|l2l|pp|ptp|delta)|verk\w*|compos\w*|concat\w*|compuest\w*)$")
"""Words that say "between lines" without saying between which."""
_NEUTRAL = ("n", "e", "g", "pe")
_NUMBERED_PHASE = re.compile(
    r"(?i)(?:(?P<folder>.*)/)?(?P<q>[uvi])(?:_?abc\s*[:_.(\[]?\s*(?P<n>[1-3])\s*[)\]]?|[_ .](?P<letter>[uvw]))"
)
"""`Vabc:1`, `Iabc(2)` of Simulink; `U_V`, `I_W` of machines, which words would take for two quantities."""


def _alike(letter: re.Match[str]) -> str:
    """In Latin the letter of a phase that looks like one in Cyrillic, alone or behind U or I."""
    return letter[0].translate(str.maketrans("АВСавс", "ABCabc"))


_WORDS_OF_OTHERS: tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...] = (
    (r"(?i)\b(?:a|phv|pnv)\.(?:neut|res|net)\b", "neutral"),  # IEC 61850-7-4: MMXU1.A.neut
    (r"(?i)volsv", "voltage"), (r"(?i)ampsv", "current"), (r"(?i)instmag(?:\.[if]\b)?", "inst"),  # TVTR1.VolSv.instMag
    ("电压|電圧|電壓", " voltage "), ("电流|電流", " current "), ("零序|中性", " neutral "), ("相", " phase "),
    (r"(?i)tens(?:ão|ión)", "voltage"),
    (r"(?i)напряжение", "voltage"), (r"(?i)\bток\b", "current"), (r"(?i)нейтрал\w*|\bнул\w*", "neutral"),
    (r"(?i)\bфаз[аы]\b", "phase"), (r"(?:(?<![^\W_])[АВС]|(?<=^[UIVuiv])[АВСавс])(?![^\W_])", _alike),
)  # fmt: skip


def _latin(name: str) -> str:
    """A name with the words of IEC 61850, and those that are not written in ASCII, in English."""
    for word, english in _WORDS_OF_OTHERS:
        name = re.sub(word, english, name)
    return name


@dataclass(frozen=True, slots=True)
class Reading:
    """One meaning of a name."""

    kind: Kind
    quantity: Letter = UNKNOWN
    family: str = ""
    phases: tuple[int, ...] = ()
    group: str = ""


_INPUT = re.compile(r"(?i)(^|[^a-z])(channel|ch|kanal|canal|canale|voie)[ _-]*([a-h]|\d+)($|[^a-z0-9])")
"""Of an instrument: `Channel A`, `CH2`."""
_BARE_INPUT = re.compile(r"(?i)(^|[^a-z])(input|eingang|entr[ée]e|ingresso|entrada|ingang)[ _-]*[a-h]($|[^a-z0-9])")
"""Of an instrument where no quantity is beside it: `Input B`; `Voltage Input B` is of a converter fed by phase B."""


def readings(name: str) -> list[Reading]:
    """All meanings of a channel's name; none where it says nothing."""
    name = _latin(name)
    if numbered := _NUMBERED_PHASE.fullmatch(name.strip()):
        letter, folder = _QUANTITY[numbered["q"].lower()], (numbered["folder"] or "").lower()
        if numbered["n"]:
            return [Reading("phase", letter, "123", (int(numbered["n"]),), folder)]
        return [Reading("phase", letter, "uvw", ("uvw".index(numbered["letter"].lower()) + 1,), folder)]
    words = _words(name)
    quantity = next((_QUANTITY[word] for word in words if word in _QUANTITY and len(word) > 1), UNKNOWN)
    plain = [word for word in words if not (word in _QUANTITY and len(word) > 1)]
    if special := _special(plain, quantity):
        return [special]
    bare = not any(word in _QUANTITY for word in words) and _BARE_INPUT.search(name)
    if name.strip().isdigit() or _INPUT.search(name) or bare:
        return [Reading("unknown", quantity)] if quantity else []  # an input of an instrument is no phase
    core = [word for word in plain if word not in _FILLER]
    found = _designated(core, quantity)
    if any(_BETWEEN.match(word) for word in words) or max(words.count(word) for word in ("line", "phase", "ph")) > 1:
        found = [one for one in found if one.kind == "line"] or [Reading("unknown", quantity or "u")]
    if found:
        return found
    if (len(core) == 1 and core[0] in _QUANTITY) or (not core and quantity):
        return [Reading("phase", _QUANTITY[core[0]] if core else quantity, "123", (1,))]
    letter = next((_QUANTITY[word] for word in core if word in _QUANTITY), quantity)
    return [Reading("unknown", letter)] if letter else []


def says_a_quantity_alone(name: str) -> bool:
    """Whether a name like `U`, `I` or `Voltage` says no phase, where something else does."""
    core = [word for word in _words(_latin(name)) if word not in _FILLER]
    return len(core) == 1 and core[0] in _QUANTITY


def without_quantity(name: str) -> tuple[str, ...]:
    """The words of a name that say no voltage and no current: `x1`, `output` of `X1_OutputVoltage`."""
    return tuple(word for word in _words(_latin(name)) if word not in _QUANTITY)


def says_to_neutral(name: str) -> bool:
    """Whether the name of a voltage says to neutral or earth: `V1N`, `Van`, `U_RN`, `UL1-N`, `uL1E`."""
    return any(
        word == "n" or re.fullmatch(r"\d*[uv]?(?:l|ph)?[abcrstyuvw123][neg]", word) for word in _words(_latin(name))
    )


def phase_field(text: str, machine: bool = False) -> list[Reading]:
    """Meanings of the field of the phase in COMTRADE: `A`, `L1-N`, `AB`, `N`, `3`; some recorders write `I1`.

    `machine`: the fields name phases U, V, W, of which two are letters of a voltage, too.
    """
    words = [word for word in _words(_latin(text)) if word not in _FILLER]
    if not words:
        return []
    if machine and len(words) == 1 and words[0] in ("u", "v", "w"):
        return [Reading("phase", family="uvw", phases=("uvw".index(words[0]) + 1,))]
    if all(word in _NEUTRAL or _RESIDUAL.match(word) for word in words):
        return [Reading("residual")]
    return [one for one in _designated(words, "") if not one.group]


def _words(name: str) -> list[str]:
    name = re.sub(r"(?i)(?<![a-z])([uv])([123])-(?!\2)([123])(?![a-z\d])", r"\1\2\3", name)  # V1-2
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z][a-z]|[A-Z]\d|[A-Z]$)", " ", name)  # CurrentL1, phaseA
    words: list[str] = []
    for word in re.split(r"[^a-z0-9]+", spaced.lower()):
        whole = next((w for w in _WORD_QUANTITY if word.startswith(w)), "")
        words += [whole, word[len(whole) :]]
    split: list[str] = []
    for word in words:
        if place := re.fullmatch(r"([uvi])(grid|load|mains|line|supply|netz)", word):
            split += [place[1], place[2]]
            continue
        tail = re.fullmatch(r"(?:phase|ph)([a-crsty123]|l[123])", word)
        split += ["phase", tail.group(1)] if tail else [word]
    return [word for word in split if word]


def _special(words: list[str], quantity: Letter) -> Reading | None:
    """What is never a phase: direct, computed, residual, synchronising quantities."""
    letter = next((w[0] for w in words if w[0] in "uvi" and len(w) <= 5), "")
    kind = quantity or (_QUANTITY[letter] if letter else UNKNOWN)
    if any(_DC.match(word) and not re.fullmatch(r"[uvi]?[a-z]?\d?[a-c]dc", word) for word in words):
        return Reading("dc", kind)
    if any(word in _COMPUTED or re.fullmatch(r"[uvi][a-c1-3]?(rms|mag|ang|thd|eff)", word) for word in words):
        return Reading("computed", kind)
    if any(_SYNC.match(word) for word in words):
        return Reading("sync", "u")
    if any(word in _OTHER for word in words) or (len(words) == 1 and re.fullmatch(r"d\d{1,2}", words[0])):
        return Reading("other")  # D0 .. D15: digital inputs of an oscilloscope
    if any(re.fullmatch(r"3[uvi][0o]?", word) for word in words):
        return Reading("residual", kind)
    volts = kind == "u" and "i" not in words
    residual = [word for word in words if _RESIDUAL.match(word) and not (volts and word == "in")]  # V(in): an input
    phases = [word for word in words if word not in residual and word not in _FILLER and _single(word)]
    if any(len(word) > 1 and word[0] == "i" for word in residual):  # IN-1: of feeder 1
        phases = [word for word in phases if not word.isdigit()]
    if residual and not phases:
        return Reading("residual", kind)
    return None


_LEAD = r"^(?P<before>\d*)(?P<quantity>[uvi])?(?:l|ph)?"
_NUMBERED = r"^(?P<before>\d*)(?P<quantity>[uvi])(?P<middle>\d+)"
"""`u1a`: the voltage of phase A of feeder 1."""


def _designated(words: list[str], quantity: Letter) -> list[Reading]:
    """Readings of words such as `va`, `l1`, `u12`, `ia` + `g1`, `l1` + `l2`, `v` + `a` + `n`."""
    found: list[Reading] = []
    taken = 0  # words that are the second phase of a pair
    for at, word in enumerate(words):
        rest = words[at + 1 :]
        if at < taken:
            continue
        for reading in _word(word, quantity, rest):
            used = 1 + _partners(reading, rest)
            taken = max(taken, at + used)
            group = " ".join(w for w in (*words[:at], reading.group, *words[at + used :]) if w and w not in _NEUTRAL)
            group = " ".join(w for w in group.split() if w not in ("u", "v", "i"))
            next_word = words[at + used : at + used + 1]  # L1_U; but the I of BUS I behind it is a number
            letter: Letter = reading.quantity or quantity or _first(words[:at]) or _first(next_word)
            found.append(Reading(reading.kind, letter, reading.family, reading.phases, group))
    strong = [one for one in found if one.quantity]
    return list(dict.fromkeys(strong or found))


def _first(words: list[str]) -> Letter:
    return next((_QUANTITY[word] for word in words if word in _QUANTITY), UNKNOWN)


def _word(word: str, quantity: str, rest: list[str]) -> list[Reading]:
    """Readings of one word, with the next words where those complete a pair."""
    found = []
    for family, letters in FAMILIES.items():
        d = f"[{letters}]"
        pair = re.match(rf"{_LEAD}(?P<a>{d})(?:[uvi])?(?:l|ph)?(?P<b>{d})(?P<after>\w*)$", word)
        single = re.match(rf"{_LEAD}(?P<a>{d})(?P<neutral>n|e|g)?(?P<after>\d*|[a-z]\d*)$", word)
        numbered = re.match(rf"{_NUMBERED}(?P<a>{d})(?:n|e|g)?$", word) if family != "123" else None
        if numbered:
            phase = letters.index(numbered["a"]) + 1
            found.append(Reading("phase", _letter(numbered["quantity"]), family, (phase,), numbered["middle"]))
        # Without a quantity, only digits may follow: BAY1 and BANK are no voltages from B to A.
        plain = pair is not None and len(word) <= 4 and not re.search(r"\D", pair["after"])
        if pair and pair["a"] != pair["b"] and (pair["quantity"] or quantity or plain):
            phases = (letters.index(pair["a"]) + 1, letters.index(pair["b"]) + 1)
            found.append(Reading("line", _letter(pair["quantity"]), family, phases, pair["before"] + pair["after"]))
        if family == "123" and not quantity and re.fullmatch("a[123]", word):
            found.append(Reading("phase", "i", AMPERES, (int(word[1]),)))
        if single is None or (family == "123" and single["before"]):
            continue
        named = single["quantity"] or re.match(r"^(l|ph)", word) or re.fullmatch(rf"{d}[neg]?", word)
        if not named or (word in ("u", "v", "i") and not quantity):
            continue
        phase = letters.index(single["a"]) + 1
        partner = _partner(family, letters, rest)
        if partner and partner != phase:
            found.append(Reading("line", _letter(single["quantity"]), family, (phase, partner), single["before"]))
        else:
            group = single["before"] + single["after"]
            found.append(Reading("phase", _letter(single["quantity"]), family, (phase,), group))
            if family == "123" and single["after"] in ("1", "2", "3"):  # I12: of phase 1 or of feeder 1
                swapped = (int(single["after"]),)
                found.append(Reading("phase", _letter(single["quantity"]), family, swapped, str(phase)))
    return found


def _letter(letter: str | None) -> Letter:
    return _QUANTITY[letter] if letter else UNKNOWN


def _partner(family: str, letters: str, rest: list[str]) -> int:
    """The second phase of a pair, if the next word is one: `l1` + `l2`, `va` + `vb`, `a` + `b`."""
    if not rest:
        return 0
    match = re.fullmatch(rf"(?P<lead>[uvi]?l?|ph)(?P<d>[{letters}])", rest[0])
    if match is None or (family == "123" and not match["lead"]):
        return 0
    return letters.index(match["d"]) + 1


def _partners(reading: Reading, rest: list[str]) -> int:
    """How many of the next words the reading has used."""
    if reading.kind == "line" and rest and _partner(reading.family, FAMILIES[reading.family], rest):
        return 1
    return 1 if reading.kind == "phase" and rest and rest[0] in _NEUTRAL else 0


def _single(word: str) -> bool:
    return re.fullmatch(r"\d*[uvi]?(l|ph)?[a-crstyuw123](n|e|g)?\w?\d*", word) is not None and word not in ("n", "e")
