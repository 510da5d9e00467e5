"""The role of every channel of a recording, with the evidence: unit, field of the phase, name, and the other channels.

A letter has a meaning beside its family only: S is a phase where R and T are there, and the synchronising voltage where
A, B and C are. So families are established first, by all channels together.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import replace
from typing import TypeAlias

from acqd.sources.recording.channel import UNKNOWN, Channel, Letter, Role
from acqd.sources.recording.label import AMPERES, Reading, phase_field, readings, says_a_quantity_alone
from acqd.sources.recording.units import UnknownUnitError, unit_of

_ALONE = ("abc", "123")
"""Families whose letters mean phases also where one of the three is missing."""
NO_PHASE = "its name says no phase"
DISAGREE = "its name and its phase field"


def roles_of(channels: list[Channel]) -> list[Role]:
    """One role per channel."""
    stated, channels = channels, _from_one(_without_units(_without_default(channels)))
    machine = {"U", "V", "W"} <= {channel.phase.strip().upper() for channel in channels}
    candidates = [_candidates(channel, machine) for channel in channels]
    if any(re.search(r"(?i)[uv]l?(11|22|33)$", channel.name.strip()) for channel in channels):
        candidates = [[one for one in found if (one.kind, one.family) != ("line", "123")] for found in candidates]
    whole = _whole(candidates)
    if not _are_amperes(channels, candidates, whole):
        candidates = [[one for one in found if one.family != AMPERES] for found in candidates]
    own = [replace(channel, name=one.name) for channel, one in zip(channels, stated, strict=True)]
    roles = [_role(channel, found, whole) for channel, found in zip(own, candidates, strict=True)]
    roles = [_not_sequence(role, roles) for role in roles]
    return _only_ones(own, roles)


def _without_default(channels: list[Channel]) -> list[Channel]:
    """Without phase fields that a recorder has left at one value, which the names of its channels show."""
    fields = {channel.phase.strip() for channel in channels}
    phases = {one.phases for channel in channels for one in readings(channel.name) if one.family in _ALONE}
    return [replace(channel, phase="") for channel in channels] if len(fields) == 1 and len(phases) > 1 else channels


_BRACKETED = re.compile(r"(.+?)\s*[\[(]([kKmMuµ]?[VAva])[\])]")


def _without_units(channels: list[Channel]) -> list[Channel]:
    """Without the units that all names end with, as in `IAW(A)`; `Current (A)` beside `Current (B)` names a phase."""
    found = [_BRACKETED.fullmatch(channel.name.strip()) for channel in channels]
    units: dict[str, set[str]] = defaultdict(set)
    for channel, one in zip(channels, found, strict=True):
        units[channel.unit.strip()[-1:].upper()].add(one[2][-1].upper() if one else "")
    same = {unit for unit, seen in units.items() if seen == {unit}}
    return [
        replace(channel, name=one[1]) if one is not None and one[2][-1].upper() in same else channel
        for channel, one in zip(channels, found, strict=True)
    ]


_INDEXED = re.compile(r"(?i)_?((?:[UVI](?:L|LN|L_N)?|voltage|current))\[([0-9])\]")
"""Elements of an array, such as `ULN[0]` of Janitza."""


def _from_one(channels: list[Channel]) -> list[Channel]:
    """With the phases 1, 2, 3 in names whose numbers are 0, 1, 2."""
    found = [_INDEXED.fullmatch(channel.name.strip()) for channel in channels]
    numbers: dict[str, set[str]] = defaultdict(set)
    for one in filter(None, found):
        numbers[one[1]].add(one[2])
    zero = {stem for stem, seen in numbers.items() if {"0", "1", "2"} <= seen}
    return [
        replace(channel, name=f"{one[1][0]}{int(one[2]) + 1}") if one is not None and one[1] in zero else channel
        for channel, one in zip(channels, found, strict=True)
    ]


def _are_amperes(channels: list[Channel], candidates: list[list[Reading]], whole: set[_Key]) -> bool:
    """Whether A1 A2 A3 are currents: no others are there, and voltages of the same numbers. Else they are inputs.

    Where one of the three is missing, their unit must be that of a current.
    """
    numbered: dict[str, set[tuple[int, ...]]] = defaultdict(set)
    units = set()
    for channel, found in zip(channels, candidates, strict=True):
        for one in found:
            if one.quantity == "i" and one.family != AMPERES:
                return False
            if one.family == AMPERES or (one.family, one.kind) == ("123", "phase"):
                numbered[one.family].add(one.phases)
            if one.family == AMPERES:
                units.add(channel.unit.strip()[-1:].upper())
    families = {family for family, _, quantity, _ in whole if family == AMPERES or quantity != "i"}
    return families >= {AMPERES, "123"} or (units == {"A"} and numbered[AMPERES] == numbered["123"])


def _candidates(channel: Channel, machine: bool) -> list[Reading]:
    """Readings of the name and of the phase field that do not contradict each other; `machine`: see `phase_field`."""
    named, field = _named(channel), phase_field(channel.phase, machine)
    special = [one for one in named if one.kind not in ("phase", "line", "unknown")]
    if special:
        return special
    if any(one.kind == "residual" for one in field):
        return [Reading("residual", named[0].quantity if named else "")]
    if not field:
        return named
    if says_a_quantity_alone(channel.name):
        quantity = UNKNOWN if channel.unit.strip() else named[-1].quantity  # U and V are letters of phases, too
        return [replace(one, quantity=quantity) for one in field]
    if _contradicts(named, field):
        return [Reading("unknown", next((one.quantity for one in named if one.quantity), UNKNOWN))]
    agreeing = [replace(one, family=other.family) for one in named for other in field if _same(one, other)]
    lines = [one for one in named if one.kind == "line"]
    if agreeing:  # recorders without a word for two phases write VAB of phase A
        return agreeing + [one for one in lines if one not in agreeing]
    field_lines = [one for one in field if one.kind == "line"]
    quantity = next((one.quantity for one in named if one.quantity), UNKNOWN)
    if field_lines:
        return [replace(one, quantity=quantity) for one in field_lines]
    if lines:  # most recorders have no name for two phases in the field
        return lines
    phases = [one for one in named if one.kind == "phase"]
    if phases and not any(one.phases == other.phases for one in phases for other in field):
        return [Reading("unknown", quantity)]
    groups = [one.group for one in named] or [""]
    return [replace(one, quantity=quantity, group=groups[0]) for one in field]


def _named(channel: Channel) -> list[Reading]:
    """Readings of the name; A1 is a current only where neither a phase field nor the unit says more."""
    found = [] if channel.input else readings(channel.name)
    if channel.phase.strip() or channel.unit.strip()[-1:] in ("V", "v"):
        return [one for one in found if one.family != AMPERES]
    return found


def _contradicts(named: list[Reading], field: list[Reading]) -> bool:
    """Whether the name says another phase than the field in the field's own letters: VB of phase C, although B is also
    the third of R Y B."""
    of_name, of_field = ({(one.family, one.phases) for one in many if one.kind == "phase"} for many in (named, field))
    families = {family for family, _ in of_name & of_field}
    shared = {family for family, _ in of_name} & {family for family, _ in of_field} & set(_ALONE)
    lines = any(one.kind == "line" for one in named)
    return bool(shared) and not families and not lines


def _same(one: Reading, other: Reading) -> bool:
    return one.kind == other.kind and one.phases == other.phases


_Key: TypeAlias = tuple[str, str, str, str]  # family, kind, quantity, group


def _key(one: Reading) -> _Key:
    return one.family, one.kind, one.quantity, one.group


def _whole(candidates: list[list[Reading]]) -> set[_Key]:
    """Families with all three members of a quantity and group."""
    members: dict[_Key, set[tuple[int, ...]]] = defaultdict(set)
    for found in candidates:
        for one in found:
            if one.kind in ("phase", "line"):
                members[_key(one)].add(tuple(sorted(one.phases)))
    return {key for key, phases in members.items() if len(phases) == 3}


def _role(channel: Channel, found: list[Reading], whole: set[_Key]) -> Role:
    quantity, problem = _quantity(channel, found)
    evidence = (f"unit {channel.unit}",) if channel.unit.strip() else ()
    if problem:
        return Role("other" if problem.startswith("in ") else "unknown", quantity, evidence=(*evidence, problem))
    if not found:
        return Role("unknown" if quantity else "other", quantity, evidence=(*evidence, NO_PHASE))
    if channel.phase.strip():
        evidence = (*evidence, f"phase field {channel.phase}")
    usual = [one for one in found if quantity != "i" or one.kind != "line"]
    if not usual:
        return Role("other", quantity, evidence=(*evidence, "a current between phases"))
    ranks = [_rank(one, channel, whole) for one in usual]
    if not max(ranks):
        return _stranger(channel, quantity, evidence)
    best = [one for one, rank in zip(usual, ranks, strict=True) if rank == max(ranks)]
    best = [one for one in best if one.kind == "line"] or best
    if len({one.phases for one in best}) > 1:
        return Role("unknown", quantity, evidence=(*evidence, "its name may mean two phases"))
    one = best[0]
    if one.kind == "unknown":
        why = f"{DISAGREE} {channel.phase} disagree" if channel.phase.strip() else NO_PHASE
        return Role("unknown", quantity, evidence=(*evidence, why))
    return Role(one.kind, quantity, one.phases, one.group, (*evidence, f"name {channel.name}"))


def _rank(one: Reading, channel: Channel, whole: set[_Key]) -> int:
    """How much speaks for a reading; 0: nothing."""
    if one.kind not in ("phase", "line"):
        return 5 if one.kind != "unknown" else 1
    if _key(one) in whole:
        return 4
    if not one.group and any((family, kind) == (one.family, one.kind) for family, kind, _, _ in whole):
        return 3
    if re.fullmatch(r"(?i)[uvi]_?ac\d*", channel.name.strip()) and (one.kind == "line" or not channel.phase):
        return 0  # an alternating voltage
    if one.family in (*_ALONE, AMPERES):
        return 2
    return 1 if one.phases == (1,) and one.kind == "phase" else 0  # R and U are the first of their families


def _stranger(channel: Channel, quantity: Letter, evidence: tuple[str, ...]) -> Role:
    """A letter without its family: S of the synchronising voltage, X of another winding."""
    if channel.name.lower().lstrip("uv_ -") in ("s", "x", "y", "sy") and quantity == "u":
        return Role("sync", "u", evidence=(*evidence, f"name {channel.name}, without phases R and T"))
    return Role("unknown", quantity, evidence=(*evidence, NO_PHASE))


def _quantity(channel: Channel, found: list[Reading]) -> tuple[Letter, str]:
    """Quantity, and why the channel cannot be used as such."""
    named = next((one.quantity for one in found if one.quantity), UNKNOWN)
    try:
        unit = unit_of(channel.unit)
    except UnknownUnitError as error:
        return named, f"its {error}"
    if unit is None:
        return named, ""
    if unit.quantity not in ("u", "i"):
        return "", f"in {channel.unit.strip()}, neither V nor A"
    if named and named != unit.quantity:
        words = {"u": "voltage", "i": "current"}
        return named, f"its name says {words[named]}, its unit {channel.unit.strip()}"
    return unit.quantity, ""


def _not_sequence(role: Role, roles: list[Role]) -> Role:
    """V1 and V2 beside V0, without V3, are symmetrical components."""
    if role.kind != "phase" or role.phases[0] == 3 or not role.evidence:
        return role
    alike = [one for one in roles if one.quantity == role.quantity and one.group == role.group]
    numbers = {one.phases for one in alike if one.kind == "phase"}
    name = role.evidence[-1].lower()
    zero = any(one.kind == "residual" and one.evidence and one.evidence[-1].endswith("0") for one in alike)
    if zero and numbers == {(1,), (2,)} and name[-1] in "12" and "l" not in name.rpartition(" ")[2]:
        return replace(role, kind="sequence", phases=())
    return role


def _only_ones(channels: list[Channel], roles: list[Role]) -> list[Role]:
    """One voltage and one current without a phase, and no others: they are those of L1."""
    if any(role.kind in ("phase", "line") for role in roles):
        return roles
    for quantity in ("u", "i"):
        alike = [k for k, role in enumerate(roles) if role.kind == "unknown" and role.quantity == quantity]
        if len(alike) != 1 or roles[alike[0]].evidence[-1] != NO_PHASE:
            return roles
    for k, role in enumerate(roles):
        if role.kind == "unknown" and role.quantity:
            word = "voltage" if role.quantity == "u" else "current"
            roles[k] = Role(
                "phase", role.quantity, (1,), "", (*role.evidence[:1], f"the only {word}: {channels[k].name}")
            )
    return roles
