"""Do a meter's registers make sense? And if not: which word order, scale or profile would?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from acqd.sources.meters.decode import quantity
from acqd.sources.meters.plan import Plan
from acqd.sources.meters.profile import Profile, WordOrder

_DEAD = 0.05  # share of the nominal voltage below which nothing can be judged
_V_RANGE = (0.5, 1.5)  # of the nominal voltage
_F_RANGE = (45.0, 65.0)
_PF_ERROR = 0.05
_POWER_SLACK = 0.05  # share of V x I by which |P| may exceed it: registers of one round differ in time
_LEAST_SHARE = 0.3  # of V x I x PF: a current of more than 300 % distortion is not expected
_SMALL_VA = 20.0  # below this the meters' resolution says more than the load
_MOST_KWH = 1e9
_SCALED = {
    "voltages": ("Vrms",),
    "currents": ("Irms",),
    "powers": ("P", "S"),
    "voltages and powers": ("Vrms", "P", "S"),  # a voltage transformer's ratio
}
_SCALES = (1e-3, 1e-2, 1e-1, 1e1, 1e2, 1e3)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a round of values says."""

    faults: tuple[str, ...]
    """Sentences; empty: everything agrees."""
    judged: bool
    """False: no voltage, so word order and scale show in nothing."""
    checks: int = 0
    """Relations that could be tested and hold."""


def judge(profile: Profile, values: dict[str, float | None], nominal_voltage: float) -> Verdict:
    """Test voltages, frequency and the relations between V, I, P, S, PF and f."""
    voltages = [value for k in range(profile.phases) if (value := values.get(f"L{k + 1}.Vrms")) is not None]
    alive = [value for value in voltages if abs(value) > _DEAD * nominal_voltage]
    # Half of a 32-bit pattern in the wrong place is tiny or huge, hardly ever exactly zero.
    if not alive and all(value == 0 or abs(value) > 1e-3 for value in voltages):
        return Verdict((), judged=False)
    faults: list[str] = []
    checks = 0
    for name in sorted(values):
        fault, tested = _judge_one(name, values, nominal_voltage)
        checks += tested and not fault
        faults += [fault] if fault else []
    return Verdict(tuple(faults), judged=True, checks=checks)


def _judge_one(name: str, values: dict[str, float | None], nominal: float) -> tuple[str, bool]:
    """A fault of one quantity, and whether it could be tested."""
    value = values[name]
    if value is None:
        return "", False
    channel, _, kind = name.rpartition(".")
    if kind == "Vrms" and channel != "total":
        low, high = (share * nominal for share in _V_RANGE)
        dead = 0 <= value <= _DEAD * nominal and (value == 0 or value > 1e-3)
        # One live phase is enough: an open phase picks up some volts from its neighbours.
        live = any(low <= (values.get(f"L{k}.Vrms") or 0.0) <= high for k in (1, 2, 3))
        outside = not dead and not low <= value <= high and not (live and 1e-3 < value < low)
        fault = f"{name} = {value:.6g} V, expected {low:g} to {high:g} V (nominal_voltage = {nominal:g})"
        return (fault if outside else ""), not dead
    if kind == "f":
        outside = value != 0 and not _F_RANGE[0] <= value <= _F_RANGE[1]
        return (f"f = {value:.6g} Hz, expected 45 to 65 Hz" if outside else ""), value != 0
    if kind == "PF":
        return (f"{name} = {value:.6g}, expected -1 to 1" if abs(value) > 1 + _PF_ERROR else ""), value != 0
    if kind in ("W", "W_export"):
        impossible = not -1e-3 <= value <= _MOST_KWH
        return (f"{name} = {value:.6g} kWh" if impossible else ""), value != 0
    if kind in ("P", "S"):
        return _judge_power(name, channel, kind, value, values)
    return "", False


def _judge_power(name: str, channel: str, kind: str, value: float, values: dict[str, float | None]) -> tuple[str, bool]:
    """|P| and S are at most V x I, and of a phase not far below what S and PF say.

    Distortion makes P and S smaller than V x I x cos(phi) and V x I. Totals may be vector sums, far below
    the sum of the phases where one phase feeds in.
    """
    product = _volt_ampere(channel, values)
    if product is None or max(product, abs(value)) < _SMALL_VA:
        return "", False
    unit = "W" if kind == "P" else "VA"
    slack = _POWER_SLACK * product + _SMALL_VA / 2
    if abs(value) > product + slack:
        return f"{name} = {value:.6g} {unit}, but V x I = {product:.6g} VA", True
    if channel == "total":
        return "", True
    pf = 1.0 if kind == "S" else values.get(f"{channel}.PF")
    if pf is None:
        return "", True
    expected = abs(pf) * product
    if abs(value) > expected + 0.2 * product + slack or abs(value) < _LEAST_SHARE * expected - slack:
        return f"{name} = {value:.6g} {unit}, but V x I x PF = {expected:.6g} {unit}", True
    return "", True


def _volt_ampere(channel: str, values: dict[str, float | None]) -> float | None:
    """V x I of a channel [VA]; of the total, the sum of the phases."""
    if channel == "total":
        parts = [_volt_ampere(f"L{k}", values) for k in (1, 2, 3) if f"L{k}.Vrms" in values]
        return None if not parts or None in parts else sum(part for part in parts if part is not None)
    volts, amperes = values.get(f"{channel}.Vrms"), values.get(f"{channel}.Irms")
    return None if volts is None or amperes is None else abs(volts * amperes)


def explain(profile: Profile, plan: Plan, answers: list[bytes], nominal_voltage: float) -> str:
    """What would make the registers plausible: another word order or another scale; empty: nothing known."""
    order: WordOrder = "low" if next(iter(profile.quantities.values())).word_order == "high" else "high"
    swapped = {name: replace(register, word_order=order) for name, register in profile.quantities.items()}
    if _fits(replace(profile, quantities=swapped), plan, answers, nominal_voltage):
        return f'they make sense with the {order} word first: set word_order = "{order}" for this meter'
    if _fits(profile, plan, [_exchanged(answer) for answer in answers], nominal_voltage):
        return "they make sense with the bytes of each register exchanged: set the gateway to the order of Modbus"
    for what, kinds in _SCALED.items():
        for factor in _SCALES:
            if _fits(_scaled(profile, kinds, factor), plan, answers, nominal_voltage):
                return f"they make sense with {what} times {factor:g}: check the transformer ratios set in the meter"
    if _fits(_scaled(profile, _SCALED["voltages"], 1 / math.sqrt(3)), plan, answers, nominal_voltage):
        return "they make sense with voltages by sqrt(3): these are between lines, set the meter to phase voltages"
    return ""


def _scaled(profile: Profile, kinds: tuple[str, ...], factor: float) -> Profile:
    quantities = {
        name: replace(register, scale=register.scale * factor) if name.rpartition(".")[2] in kinds else register
        for name, register in profile.quantities.items()
    }
    return replace(profile, quantities=quantities)


def _exchanged(answer: bytes) -> bytes:
    """The bytes of each register exchanged."""
    return bytes(byte for k in range(0, len(answer) - 1, 2) for byte in (answer[k + 1], answer[k]))


def _fits(profile: Profile, plan: Plan, answers: list[bytes], nominal_voltage: float) -> bool:
    verdict = judge(profile, decode(profile, plan, answers), nominal_voltage)
    return verdict.judged and not verdict.faults


def decode(profile: Profile, plan: Plan, answers: list[bytes]) -> dict[str, float | None]:
    """All quantities of one round. Currents lose the sign that some meters give them: Irms has none."""
    values = {
        name: quantity(profile, register, plan.bytes_of(register, answers))
        for name, register in profile.quantities.items()
    }
    return {
        name: abs(value) if value is not None and name.endswith(".Irms") else value for name, value in values.items()
    }
