"""Which channels are metered: by --map, else by their roles; what stays ambiguous is refused with what to type."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from acqd.errors import InputError
from acqd.sources.recording.channel import Recording, Role
from acqd.sources.recording.label import FAMILIES, readings
from acqd.sources.recording.roles import DISAGREE, NO_PHASE
from acqd.sources.recording.suggestion import suggestion
from acqd.sources.recording.units import UnknownUnitError, unit_of
from acqd.sources.waveform import LINES, ChannelMap, position, positions

_SHOWN = 6  # channels that are not metered
_LISTED = 40  # channels in an error
_PHASES = (1, 2, 3)


@dataclass(frozen=True, slots=True)
class Selection:
    """Positions of the metered channels."""

    voltages: list[tuple[tuple[int, ...], int]]
    """(phase) or (from, to), and the channel."""
    currents: list[tuple[int, int]]
    """Phase and channel."""
    notes: tuple[str, ...] = ()

    @property
    def between_lines(self) -> bool:
        """Whether the voltages are those between lines."""
        return len(self.voltages[0][0]) == 2

    @property
    def keys(self) -> list[tuple[str, int]]:
        """(u1, channel), (i1, channel), ... as in a --map."""
        voltages = [("u" + "".join(map(str, phases)), channel) for phases, channel in self.voltages]
        return voltages + [(f"i{phase}", channel) for phase, channel in self.currents]


def mapped(recording: Recording, given: ChannelMap) -> Selection:
    """The channels that the user names. Raises InputError."""
    columns = given.columns or {}
    names = [channel.name for channel in recording.channels]
    for column in columns.values():  # a channel that is not there comes before one that nobody has named
        position(recording.path, names, column, recording.noun)
    lines = [key for key in columns if key in LINES]
    if lines:
        return _mapped_lines(recording, columns, lines, names)
    pairs = given.pairs(recording.path, columns)
    phases = [phase for phase in _PHASES if f"u{phase}" in columns]
    places = positions(recording.path, names, pairs, recording.noun)
    voltages: list[tuple[tuple[int, ...], int]] = [
        ((phase,), place) for phase, place in zip(phases, places[0::2], strict=True)
    ]
    return Selection(voltages, list(zip(phases, places[1::2], strict=True)))


def _mapped_lines(recording: Recording, columns: dict[str, str], lines: list[str], names: list[str]) -> Selection:
    currents = [f"i{phase}" for phase in _PHASES]
    stray = [key for key in columns if key not in lines and key not in currents]
    if len(lines) < 2 or stray or any(key not in columns for key in currents):
        raise InputError(
            recording.path,
            "voltages between lines need two or three of them and three currents: "
            "--map u12=...,u23=...,u31=...,i1=...,i2=...,i3=...",
        )
    places = [position(recording.path, names, columns[key], recording.noun) for key in (*lines, *currents)]
    if len(set(places)) < len(places):
        raise InputError(recording.path, f"--map names a {recording.noun} twice; expected another one for each")
    voltages: list[tuple[tuple[int, ...], int]] = [
        ((int(key[1]), int(key[2])), place) for key, place in zip(lines, places, strict=False)
    ]
    return Selection(voltages, list(zip(_PHASES, places[len(lines) :], strict=True)))


def chosen(recording: Recording, roles: list[Role]) -> Selection:
    """The channels that roles name. Raises InputError."""
    # A phase that would be left out because its channel is called otherwise is no smaller number of phases.
    doubtful = any(role.evidence and role.evidence[-1].startswith(DISAGREE) for role in roles)
    for grouping in (_no_group, _by_name, _by_circuit, _by_both):
        found = _in_groups(recording, roles, grouping)
        if found is not None and not doubtful:
            _refuse_strangers(recording, roles, found)
            return found
    lacking = recording.advice and {role.quantity for role in roles} < {"u", "i", ""}
    advice = f"; {recording.advice}" if lacking else ""
    notes = "; ".join(("", *recording.notes[:_SHOWN]))  # what was left out may be what is missing
    raise InputError(recording.path, _ambiguity(recording, roles) + advice + notes)


def _refuse_strangers(recording: Recording, roles: list[Role], found: Selection) -> None:
    """Raises InputError where a voltage and a current are named like those of the phases, by a word that says none."""
    if len(found.currents) == len(_PHASES):
        return
    taken = [channel for _, channel in found.keys]
    strangers = [
        k
        for k, role in enumerate(roles)
        if role.kind in ("unknown", "other") and any(_is_alike(recording, k, channel) for channel in taken)
    ]
    like = {roles[channel].quantity for k in strangers for channel in taken if _is_alike(recording, k, channel)}
    if like == {"u", "i"}:
        names = ", ".join(repr(recording.channels[k].name) for k in strangers[:_SHOWN])
        listing = ", ".join(f"{k}={c.name}" for k, c in enumerate(recording.channels[:_LISTED]))
        raise InputError(
            recording.path,
            f"has {names}, named like those of the phases, and which phase they are of is unknown; say which with "
            f"--map u1=...,i1=..., such as {suggestion(recording.channels, roles)} ({recording.noun}s: {listing})",
        )


def _is_alike(recording: Recording, k: int, other: int) -> bool:
    """Whether two channels have one unit and one name but for a short word: `Fase V` beside `Fase A`; not `U 4`."""
    one, two = recording.channels[k], recording.channels[other]
    words, others = (re.findall(r"[^\W_]+", channel.name.lower()) for channel in (one, two))
    if len(words) < 2 or len(words) != len(others) or one.unit != two.unit:
        return False
    differing = [(a, b) for a, b in zip(words, others, strict=True) if a != b]
    return len(differing) == 1 and all(len(word) < 3 for word in differing[0]) and differing[0][0] not in _NO_PHASES


_NO_PHASES = ("n", "g", "e", "pe", *"0456789")
"""Words that tell no phase from another one."""
_Grouping = Callable[[Recording, int, Role], str]


def _no_group(_recording: Recording, _k: int, _role: Role) -> str:
    return ""


def _by_name(_recording: Recording, _k: int, role: Role) -> str:
    return role.group


def _by_circuit(recording: Recording, k: int, _role: Role) -> str:
    return recording.channels[k].circuit.strip().lower()


def _by_both(recording: Recording, k: int, role: Role) -> str:
    return f"{_by_circuit(recording, k, role)}|{role.group}"


def _in_groups(recording: Recording, roles: list[Role], grouping: _Grouping) -> Selection | None:
    """The first group whose channels are one of each; None where groups mix feeders or leave a phase incomplete."""
    groups: dict[str, dict[str, list[int]]] = {}
    for k, role in enumerate(roles):
        if role.key:
            groups.setdefault(grouping(recording, k, role), {}).setdefault(role.key, []).append(k)
    whole = {name: found for name, keys in groups.items() if (found := _whole(keys)) is not None}
    if not whole:
        return _across(recording, groups)
    best = max(len(found.currents) for found in whole.values())
    names = {name.rpartition("|")[2] for name in whole}
    if best == 1 and len(names) > 1 and any(names <= set(family) for family in FAMILIES):
        return None  # IRA, IRB, IRC: of phase R of three feeders, or of three phases of one that is called R
    selection = next(found for found in whole.values() if len(found.currents) == best)
    return Selection(selection.voltages, selection.currents, _left_out(recording, roles, selection))


def _whole(keys: dict[str, list[int]]) -> Selection | None:
    """Voltages and currents of the same phases, or line voltages with three currents."""
    phases = [phase for phase in _PHASES if f"u{phase}" in keys]
    currents = [phase for phase in _PHASES if f"i{phase}" in keys]
    metered = [key for key in keys if key[0] == "i" or (len(key) == 2 and phases)]
    if any(len(keys[key]) > 1 for key in metered):
        return None
    i = [(phase, keys[f"i{phase}"][0]) for phase in currents]
    if phases and phases == currents:
        return Selection([((phase,), keys[f"u{phase}"][0]) for phase in phases], i)
    lines = [key for key in keys if len(key) == 3]
    if phases or len(currents) < 3 or len({frozenset(key[1:]) for key in lines}) < 2:
        return None
    if any(len(keys[key]) > 1 for key in lines) or len(lines) > 3:
        return None
    return Selection([((int(key[1]), int(key[2])), keys[key][0]) for key in lines], i)


def _across(recording: Recording, groups: dict[str, dict[str, list[int]]]) -> Selection | None:
    """Voltages of a bus and currents of a feeder: where there is one group of each."""
    voltages = [keys for keys in groups.values() if any(key[0] == "u" for key in keys)]
    currents = [keys for keys in groups.values() if any(key[0] == "i" for key in keys)]
    if len(groups) != 2 or len(voltages) != 1 or len(currents) != 1 or voltages[0] is currents[0]:
        return None
    found = _whole(voltages[0] | currents[0])
    return None if found is None else Selection(found.voltages, found.currents, (_metered(recording, found),))


def _left_out(recording: Recording, roles: list[Role], selection: Selection) -> tuple[str, ...]:
    """Says which of several voltages and currents are metered."""
    taken = {channel for _, channel in selection.keys}
    others = [recording.channels[k].name for k, role in enumerate(roles) if role.quantity and k not in taken]
    if not others:
        return ()
    more = f" and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
    return (f"{_metered(recording, selection)}; it also has {', '.join(others[:_SHOWN])}{more} (--map selects)",)


def _metered(recording: Recording, selection: Selection) -> str:
    order = sorted(selection.keys, key=lambda one: (one[0][1:], one[0][0] == "i"))
    return "metered are " + ", ".join(f"{key}={recording.channels[channel].name}" for key, channel in order)


def _ambiguity(recording: Recording, roles: list[Role]) -> str:
    """What is missing or double, the channels as acqd understands them, and a line to type."""
    counts = Counter(role.key for role in roles if role.key)
    by_name = Counter((role.key, role.group) for role in roles if role.key)
    double = next((key for (key, _), count in by_name.items() if count > 1), None) or next(
        (key for key, count in counts.items() if count > 1), None
    )
    noun = recording.noun
    listing = f"({noun}s: {', '.join(f'{k}={c.name}' for k, c in enumerate(recording.channels[:_LISTED]))})"
    try_it = f"such as {suggestion(recording.channels, roles)}; acqd replay --inspect shows them {listing}"
    if double is not None:
        names = [recording.channels[k].name for k, role in enumerate(roles) if role.key == double]
        listed = " and ".join(f"{name!r}" for name in names[:4])
        count = {2: "two", 3: "three"}.get(len(names), str(len(names)))
        return f"has {count} {noun}s for {double}, {listed}; say which with --map u1=...,i1=..., {try_it}"
    wrong = [f"{c.name!r}: {r.evidence[-1]}" for c, r in zip(recording.channels, roles, strict=True) if _odd(r)]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        return (
            f"{noun} {'; '.join(wrong[:3])}{more}; say what it is with --map, and V or A per unit of the file with "
            f"--u-scale or --i-scale: {try_it}"
        )
    whole = [key for key in sorted(counts) if len(key) == 2 and key[0] in "ui"]
    if lone := next((key for key in whole if _partner(key) not in counts), None):
        unknown = [role for role in roles if role.kind == "unknown" and role.quantity == "u"]
        lines = " (u12=...,u23=... for voltages between lines)" if lone[0] == "i" and len(unknown) > 1 else ""
        else_in = _in_other_units(recording, roles)
        return f"has {lone} but no {_partner(lone)}{else_in}; power needs both: --map u1=...,i1=...{lines}, {try_it}"
    if any(len(key) == 3 and key[0] in "ui" for key in counts):
        return (
            "has voltages between lines; they need two or three of them and the currents of three lines: "
            f"--map u12=...,u23=...,i1=...,i2=...,i3=... {listing}"
        )
    computed = [c.name for c, role in zip(recording.channels, roles, strict=True) if role.kind == "computed"]
    if computed and not counts:
        return (
            f"has no voltage and current pair, but RMS or other computed values ({', '.join(computed[:_SHOWN])}); "
            f"export the waveforms, or say which {noun}s are samples with --map u1=...,i1=..., {try_it}"
        )
    else_in = _in_other_units(recording, roles)
    return f"has no voltage and current pair{else_in}; say which {noun}s with --map u1=...,i1=..., {try_it}"


def _in_other_units(recording: Recording, roles: list[Role]) -> str:
    """Names channels that their names, but not their units, make voltages or currents: `u1 [%]`."""
    named = [
        f"{channel.name!r} is {role.evidence[-1]}"
        for channel, role in zip(recording.channels, roles, strict=True)
        if role.kind == "other" and channel.unit.strip() and any(one.quantity for one in readings(channel.name))
    ]
    more = ", say what 1 is worth with --u-scale or --i-scale"
    return f" ({', '.join(named[:_SHOWN])}{more})" if named else ""


def _odd(role: Role) -> bool:
    """Whether something speaks against metering the channel, rather than nothing for it."""
    return role.kind == "unknown" and bool(role.evidence) and role.evidence[-1] != NO_PHASE


def _partner(key: str) -> str:
    return ("i" if key[0] == "u" else "u") + key[1:]


def factor_of(recording: Recording, channel: int, key: str, given: float | None) -> float:
    """V or A (primary) per unit of the file. Raises InputError for another quantity and for an unknown unit."""
    if given is not None:
        return given
    wanted, option = ("V", "--u-scale") if key[0] == "u" else ("A", "--i-scale")
    one = recording.channels[channel]
    title = f"{recording.noun} {one.name!r} for {key}"
    try:
        unit = unit_of(one.unit)
    except UnknownUnitError as error:
        raise InputError(recording.path, f"{title}: {error}, or say how many {wanted} one is with {option}") from None
    if unit is not None and unit.quantity != key[0]:
        raise InputError(
            recording.path,
            f"{title} is in {one.unit.strip()}; expected {wanted} (see --map), or say how many {wanted} its unit is "
            f"with {option}",
        )
    return one.ratio if unit is None else unit.factor * one.ratio
