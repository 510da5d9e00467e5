"""A --map to propose for channels whose roles do not say what to meter."""

from __future__ import annotations

from acqd.sources.recording.channel import Channel, Role
from acqd.sources.recording.label import without_quantity


def suggestion(channels: list[Channel], roles: list[Role]) -> str:
    """A --map with the likeliest channels by their numbers, `?` where nothing is likely."""
    keys: dict[str, int] = {}
    for k, role in enumerate(roles):
        if role.key and len(role.key) == 2:
            keys.setdefault(role.key, k)
    if not keys:
        alike = [k for k, role in enumerate(roles) if role.quantity and role.kind == "unknown"]
        volts = [k for k in alike if roles[k].quantity == "u"]
        amperes = [k for k in alike if roles[k].quantity == "i"]
        if len(volts) == 2 and not amperes:  # a current that is measured as a voltage
            return f"--map u1={volts[0]},i1={volts[1]} --u-scale 1 --i-scale 1 (A per V of the probe)"
        pairs = _pairs(channels, volts, amperes)
        keys |= {f"u{n}": volt for n, (volt, _) in enumerate(pairs, start=1) if volt is not None}
        keys |= {f"i{n}": ampere for n, (_, ampere) in enumerate(pairs, start=1) if ampere is not None}
    phases = sorted({key[1] for key in keys}) or ["1"]
    return "--map " + ",".join(f"{q}{phase}={keys.get(f'{q}{phase}', '?')}" for phase in phases for q in "ui")


def _pairs(channels: list[Channel], volts: list[int], amperes: list[int]) -> list[tuple[int | None, int | None]]:
    """Voltages with the currents of the same name but for the word of the quantity: `X1_OutputVoltage`.

    More than three pairs are no phases of one mains: the first. Without pairs by name: as many currents as voltages in
    their order, else what there is one of.
    """
    named = {k: without_quantity(channels[k].name) for k in (*volts, *amperes)}
    like = [(volt, [ampere for ampere in amperes if named[ampere] == named[volt]]) for volt in volts]
    pairs: list[tuple[int | None, int | None]] = [(volt, found[0]) for volt, found in like if len(found) == 1]
    if pairs and len({ampere for _, ampere in pairs}) == len(pairs):
        return pairs if len(pairs) <= 3 else pairs[:1]
    if len(volts) == len(amperes) <= 3:
        return list(zip(volts, amperes, strict=True))
    return [(volts[0] if len(volts) == 1 else None, amperes[0] if len(amperes) == 1 else None)]
