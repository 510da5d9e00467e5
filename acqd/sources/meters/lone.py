"""Registers that leave the others: a register changes although nothing that it hangs together with has.

P = V x I x PF and S = V x I bind the registers of a channel. Their share for distortion differs from meter to meter and
from load to load, so one round alone says little. From one round to the next, however, none of them can change alone:
a flipped bit, exchanged words or another quantity in the place of one register does that. A load that changes moves
several of them, and f of the mains does not leave by hertz while neither loads nor voltages change. A register that one
step of its resolution changes by more than noise is no witness: PF of an idle transformer is 0.00 at any P.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

Values = Mapping[str, float | None]
_STEADY = 0.03
"""Change [share] of the registers that have not changed: noise of a steady load."""
_WEIGHTY = 3 * _STEADY
"""Change of P that is weighty, as a share of S or of the sum of P."""
_VOLTS, _FACTOR, _PF, _HERTZ = 0.2, 1 / 3, 0.2, 2.0
"""Changes that are judged: of V, twice what EN 50160 allows [share]; of I, P and S by a factor of 1.5; of PF; of f."""
_SMALL_VA = 100.0
"""Below, the resolution of meters says more than the load."""
_BINDS = {
    "Vrms": (("Irms", "P"), ("Irms", "S")),
    "Irms": (("Vrms", "S"), ("Vrms", "P", "PF")),
    "S": (("Vrms", "Irms"), ("P", "PF")),
    "P": (("Vrms", "Irms", "PF"), ("S", "PF")),
    "PF": (("P", "S"), ("Vrms", "Irms", "P")),
}
"""Which registers of a channel leave a register no freedom."""
_ALIKE = 0.15
"""How near the relation of a changed V comes to the one of before with the V of before."""
_LINE = 1.35
"""Of the nominal voltage: where the neutral is lost, one phase has no more than that of the others, and all phases
together have it in no network."""


def alone(before: Values, values: Values, nominal_voltage: float, steps: Mapping[str, float]) -> set[str]:
    """Names of registers that contradict the others, from the last values that were believed to those of this round.

    `steps`: resolution of the registers, 0 where it is not known.
    """
    found = {f"{channel}.Vrms" for channel in _CHANNELS if _voltage_left(channel, before, values)}
    found |= _between_lines(values, nominal_voltage)
    for channel in _CHANNELS:
        found |= _of_channel(channel, before, values, steps)
    found |= _of_sum(before, values, steps)
    f, last = values.get("f"), before.get("f")
    supply = [name for name in values if name.endswith((".Irms", ".Vrms"))]
    loaded = any(name.endswith(".Irms") for name in supply)
    if f and last and abs(f - last) > _HERTZ and loaded and all(_same(name, before, values) for name in supply):
        found.add("f")
    return found


_CHANNELS = ("L1", "L2", "L3", "total")


def _of_channel(channel: str, before: Values, values: Values, steps: Mapping[str, float]) -> set[str]:
    changed = {kind for kind in _BINDS if not _same(f"{channel}.{kind}", before, values)}
    present = {kind for kind in _BINDS if values.get(f"{channel}.{kind}") is not None}
    if len(changed & present) != 1 or _apparent(channel, before) < _SMALL_VA:
        return set()
    [kind] = changed & present
    if kind == "P" and _small_change(channel, before, values):
        return set()  # P of a reactive load, within the phase error of transformers
    if _disagreement(channel, values) < _disagreement(channel, before):
        return set()  # the value of before was the wrong one
    witnesses = {one for one in present - changed if _fine(f"{channel}.{one}", values, steps)}
    bound = any(witnesses.issuperset(others) for others in _BINDS[kind])
    return {f"{channel}.{kind}"} if bound and _far(f"{channel}.{kind}", before, values, steps) else set()


def _small_change(channel: str, before: Values, values: Values) -> bool:
    """Whether P has changed by a small share of S."""
    change = abs((values[f"{channel}.P"] or 0.0) - (before.get(f"{channel}.P") or 0.0))
    return change <= _WEIGHTY * _apparent(channel, before)


def _of_sum(before: Values, values: Values, steps: Mapping[str, float]) -> set[str]:
    """P of a phase or the total that changes alone, although the sum binds them."""
    names = [name for name in ("L1.P", "L2.P", "L3.P", "total.P") if name in values]
    changed = [name for name in names if not _same(name, before, values)]
    if len(names) < 3 or "total.P" not in names or len(changed) != 1:
        return set()
    [name] = changed
    now, last, total = values[name], before.get(name), before.get("total.P")
    if now is None or last is None or total is None:
        return set()
    weighty = abs(now - last) > max(_WEIGHTY * sum(abs(before.get(one) or 0.0) for one in names[:-1]), _SMALL_VA)
    channel = name.partition(".")[0]
    others = [f"{channel}.{kind}" for kind in _BINDS if kind != "P" and f"{channel}.{kind}" in values]
    still = all(_same(other, before, values) for other in others)
    return {name} if weighty and still and _far(name, before, values, steps) else set()


def _voltage_left(channel: str, before: Values, values: Values) -> bool:
    """Whether V has left its value, and S or P of any load that of V x I by as much."""
    V, last = values.get(f"{channel}.Vrms"), before.get(f"{channel}.Vrms")
    if not V or not last or abs(V - last) <= _VOLTS * last:
        return False
    relation, usual = _relation(channel, values), _relation(channel, before)
    if relation is None or usual is None:
        return False
    return abs(relation * V / last / usual - 1) < _ALIKE < abs(relation / usual - 1)


def _between_lines(values: Values, nominal_voltage: float) -> set[str]:
    """All voltages of two or three phases that no network has to the neutral."""
    names = [name for name in ("L1.Vrms", "L2.Vrms", "L3.Vrms") if values.get(name) is not None]
    above = all((values[name] or 0.0) > _LINE * nominal_voltage for name in names)
    return set(names) if len(names) > 1 and above else set()


def _relation(channel: str, values: Values) -> float | None:
    """S / (V x I), of meters without S |P| / (V x I x PF)."""
    P, S, PF = (values.get(f"{channel}.{kind}") for kind in ("P", "S", "PF"))
    product = _product(channel, values)
    if product < _SMALL_VA:
        return None
    if S:
        return abs(S) / product
    return abs(P / PF) / product if P and PF and abs(PF) > _PF else None


def _apparent(channel: str, values: Values) -> float:
    P, S = (values.get(f"{channel}.{kind}") or 0.0 for kind in ("P", "S"))
    return max(abs(S), _product(channel, values), abs(P))


def _product(channel: str, values: Values) -> float:
    """V x I, 0 where one is not known."""
    return (values.get(f"{channel}.Vrms") or 0.0) * (values.get(f"{channel}.Irms") or 0.0)


def _disagreement(channel: str, values: Values) -> float:
    """How far S is from V x I and P from S x PF: the larger logarithm; of P without PF, how far it is above S."""
    P, S, PF = (abs(values.get(f"{channel}.{kind}") or 0.0) for kind in ("P", "S", "PF"))
    product = _product(channel, values)
    found = 0.0
    if S and product:
        found = abs(math.log(S / product))
    if P and (S or product):
        ratio = P / (S or product)
        found = max(found, abs(math.log(ratio / PF)) if PF else math.log(ratio))
    return found


def _same(name: str, before: Values, values: Values) -> bool:
    """Whether a register has hardly changed; a register that either round lacks has changed."""
    now, last = values.get(name), before.get(name)
    return now is not None and last is not None and abs(now - last) <= _STEADY * max(abs(now), abs(last))


def _fine(name: str, values: Values, steps: Mapping[str, float]) -> bool:
    """Whether one step of the resolution is no more than the noise of a steady load."""
    return steps.get(name, 0.0) <= _STEADY * abs(values[name] or 0.0)


def _far(name: str, before: Values, values: Values, steps: Mapping[str, float]) -> bool:
    """Whether a register has changed by more than noise, distortion and two steps of its resolution explain."""
    now, last, kind = values[name], before.get(name), name.rpartition(".")[2]
    if now is None or last is None or abs(now - last) <= 2 * steps.get(name, 0.0):
        return False
    if kind == "PF":
        return abs(abs(now) - abs(last)) > _PF
    if kind != "Vrms" and now * last < 0 and abs(now + last) <= _STEADY * abs(last):
        return False  # a load that returns what it has drawn: the sign is the one thing that changes
    return abs(now - last) > (_VOLTS if kind == "Vrms" else _FACTOR) * max(abs(now), abs(last))
