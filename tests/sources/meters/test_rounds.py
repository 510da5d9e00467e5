"""Rounds of a meter are judged as long as it is read."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acqd.sources.meters import Reading, load_profile
from acqd.sources.meters.agreement import EnergyAgreement
from acqd.sources.meters.decode import quantity
from acqd.sources.meters.profile import Register
from acqd.sources.meters.rounds import RoundJudge

SECOND = 1_000_000_000


def good(**changes):
    values = {f"L{k}.{name}": value for k in (1, 2, 3) for name, value in
              (("Vrms", 230.0), ("Irms", 2.0), ("P", 414.0), ("S", 460.0), ("PF", 0.9))}  # fmt: skip
    values |= {"total.P": 1242.0, "total.S": 1380.0, "f": 50.0, "total.W": 1000.0, "total.W_export": 10.0}
    return values | {name.replace("_", ".", 1): value for name, value in changes.items()}


def energies(readings, step_s=1.0):
    judge = RoundJudge(230.0)
    judged = [judge.judge(good() | {"total.W": W}, round(k * step_s * SECOND)) for k, W in enumerate(readings)]
    return [one.values["total.W"] for one in judged], [set(one.flags) for one in judged]


@pytest.mark.parametrize("kind", ["i16", "u16", "i32", "u32", "i64", "u64"])
def test_end_stops_of_a_type_are_no_values(kind):
    profile = load_profile("em24")
    register = Register(0, kind, 3, "high")
    bits = 16 * register.width
    marks = {"i": ((1 << bits - 1) - 1, 1 << bits - 1), "u": ((1 << bits) - 1,)}[kind[0]]
    if bits == 32:
        marks += (0x7FFFFFFF, 0x80000000)
        marks += (0x7FFF1234, 0x80000001) if kind == "i32" else ()
    for raw in marks:
        assert quantity(profile, register, raw.to_bytes(bits // 8, "big")) is None, hex(raw)
    for raw in (0, 1, 4600, (1 << bits - 2)):
        assert quantity(profile, register, raw.to_bytes(bits // 8, "big")) is not None


def test_an_overflow_of_the_display_is_no_power():
    register = load_profile("em24").quantities["L1.P"]  # low word first
    for words in ((0xFFFF, 0x7FFF), (0x0000, 0x8000), (0x1234, 0x7FFF)):
        data = b"".join(word.to_bytes(2, "big") for word in words)
        assert quantity(load_profile("em24"), register, data) is None


@pytest.mark.parametrize("bad", [0.0, 0.5, 999.0, -1.0, 1e7, 65_536.0, None])
@pytest.mark.parametrize("rounds", [1, 3])
def test_a_register_that_reads_something_else_for_a_moment_is_null_and_flagged(bad, rounds):
    before, after = [1000.0, 1000.1], [1000.4, 1000.5, 1000.6]
    W, flags = energies([*before, *[bad] * rounds, *after])
    assert [*before, *[None] * rounds, *after] == W
    assert all(
        ("invalid" in named) == (value is None and bad is not None) for value, named in zip(W, flags, strict=True)
    )


def test_a_meter_that_is_exchanged_is_another_one_and_the_energy_goes_on():
    readings = [1000.0, 1000.5, *[0.1 * k for k in range(30)]]
    W, flags = energies(readings)
    reset = [k for k, named in enumerate(flags) if "meter_reset" in named]
    assert len(reset) == 1 and 11 <= reset[0] <= 14
    assert W[reset[0] - 1] is None and W[reset[0]] == pytest.approx(1000.5 + readings[reset[0]])
    known = [value for value in W if value is not None]
    assert known == sorted(known) and known[-1] == pytest.approx(1000.5 + readings[-1])


def test_a_meter_that_starts_with_zero_has_no_energy_until_that_lasts():
    W, _ = energies([0.0, 0.0, 12_245.0, 12_245.1])
    assert W == [None, None, 12_245.0, 12_245.1]
    W, _ = energies([0.0] * 15 + [0.01])
    assert W[0] is None and W[-1] == 0.01 and W[-2] == 0.0


@pytest.mark.parametrize("mark", [0.0, 9_999_999.9, 21_474_836.47, 3.0])
def test_a_first_reading_that_is_none_does_not_become_the_energy(mark):
    for expected, readings in ((mark, [12_245.0, 12_245.1, 12_245.1]), (12_245.0, [mark, 12_245.0, 12_245.1])):
        judge = RoundJudge(230.0)
        judge.expect(good() | {"total.W": expected})
        judged = [judge.judge(good() | {"total.W": W}, k * SECOND) for k, W in enumerate(readings)]
        W = [one.values["total.W"] for one in judged]
        assert W[1:] == ([12_245.1, 12_245.1] if expected == mark else [None, 12_245.1]) and W[0] is None
        assert not any("meter_reset" in one.flags for one in judged)


def test_an_outage_of_hours_is_no_jump():
    judge = RoundJudge(230.0)
    assert judge.judge(good(), 0).values["total.W"] == 1000.0
    assert judge.judge(good() | {"total.W": 1055.0}, 5 * 3600 * SECOND).values["total.W"] == 1055.0


@settings(max_examples=50, deadline=None)
@example([0.0, 0.0, 0.0, -0.001], 4.0)  # the reading that confirms a reset is below the first one
@given(st.lists(st.one_of(st.none(), st.floats(-1e9, 1e9), st.just(0.0)), max_size=60), st.floats(0.1, 20.0))
def test_whatever_the_register_says_the_energy_only_rises(readings, step_s):
    known = [value for value in energies([1000.0, *readings], step_s)[0] if value is not None]
    assert known == sorted(known)


@pytest.mark.parametrize(
    ("wrong", "null"),
    [({"L1.P": -214_748_364.8}, "L1.P"), ({"total.P": 3e6}, "total.P"), ({"L2.Vrms": 6553.5}, "L2.Vrms"),
     ({"f": 6.5}, "f"), ({"f": 655.35}, "f"), ({"L1.PF": 32.767}, "L1.PF"), ({"L1.Irms": 0.0}, "L1.Irms"),
     ({"L2.Vrms": 0.0}, "L2.Vrms"), ({"L2.PF": 0.0}, "L2.PF"), ({"total.PF": 0.1}, "total.PF"),
     ({"total.P": 0.0}, "total.P"), ({"total.P": -1242.0}, "total.P"), ({"total.P": 414.0}, "total.P"),
     ({"L3.S": 9e5}, "L3.S"), ({"L1.Vrms": -0.1}, "L1.Vrms"), ({"total.W_export": -5.0}, "total.W_export")],
)  # fmt: skip
def test_what_no_supply_has_or_the_other_registers_contradict_is_null(wrong, null):
    judge = RoundJudge(230.0)
    judged = judge.judge(good() | wrong, 0)
    assert judged.values[null] is None and "invalid" in judged.flags
    assert {name for name, value in judged.values.items() if value is None} == {null}


def test_a_frequency_of_zero_beside_mains_is_null():
    assert RoundJudge(230.0).judge(good() | {"f": 0.0}, 0).values["f"] is None
    dead = good() | {f"L{k}.{n}": 0.0 for k in (1, 2, 3) for n in ("Vrms", "Irms", "P", "S", "PF")}
    assert RoundJudge(230.0).judge(dead | {"total.P": 0.0, "total.S": 0.0, "f": 0.0}, 0).values["f"] == 0.0


def test_regeneration_distortion_and_idle_meters_are_not_contradicted():
    judge = RoundJudge(230.0)
    regenerating = good() | {f"L{k}.P": -414.0 for k in (1, 2, 3)} | {"total.P": -1242.0}
    rectifier = good() | {f"L{k}.{n}": v for k in (1, 2, 3) for n, v in (("P", 150.0), ("S", 180.0), ("PF", 0.83))}
    rectifier |= {"total.P": 450.0, "total.S": 540.0}
    idle = (
        good()
        | {f"L{k}.{n}": 0.0 for k in (1, 2, 3) for n in ("Irms", "P", "S", "PF")}
        | {"total.P": 0.0, "total.S": 0.0}
    )
    lone = good() | {f"L{k}.Vrms": 0.0 for k in (2, 3)} | {f"L{k}.{n}": 0.0 for k in (2, 3) for n in ("Irms", "P", "S")}
    lone |= {"total.P": 414.0, "total.S": 460.0}
    for values in (regenerating, rectifier, idle, lone):
        assert judge.judge(values, 0).values == values


def test_rows_have_the_sign_of_p_and_no_sum_without_its_parts():
    from acqd.daemon.meter_feed import _timed_rows

    def rows(**changes):
        reading = Reading(
            "m", 3, 0, SECOND, good() | {k.replace("_", ".", 1): v for k, v in changes.items()}, frozenset()
        )
        return {timed.row.channel: timed.row for timed in _timed_rows(reading, "b", [])}

    assert rows(L1_P=-414.0, total_P=-1242.0)["L1"].PF == -0.9
    assert rows(L1_PF=-0.9)["L1"].PF == 0.9
    assert rows(L1_P=None)["L1"].PF is None
    assert rows()["total"].W == 990.0
    assert rows(total_W_export=None)["total"].W is None and rows(total_W=None)["total"].W is None


def test_p_that_reads_0_for_a_moment_is_no_measurement_beside_s_and_pf():
    judge = RoundJudge(230.0)
    judge.judge(good(), 0)
    values = judge.judge(good(L1_P=0.0), SECOND).values
    assert values["L1.P"] is None and values["L1.PF"] == 0.9 and values["L2.P"] == 414.0
    distorted = good(L1_P=230.0, L1_PF=1.0)  # cos phi of a load whose current has a THD of 173 %
    assert judge.judge(distorted, 2 * SECOND).values["L1.P"] == 230.0


def without(values, *kinds):
    return {name: value for name, value in values.items() if name.rpartition(".")[2] not in kinds}


@pytest.mark.parametrize(("wrong", "caught"), [(0.0, True), (-414.0, True), (41.4, True), (380.0, False)])
def test_one_answer_shows_that_the_phases_are_not_the_total(wrong, caught):
    values = without(good(L2_P=wrong), "S", "PF")
    judged = RoundJudge(230.0, one_moment=True).judge(values, 0)
    assert [judged.values[name] is None for name in ("L1.P", "L2.P", "total.P")] == [caught] * 3
    assert ("invalid" in judged.flags) == caught
    assert (
        not RoundJudge(230.0).judge(without(good(L2_P=41.4), "S", "PF"), 0).flags
    )  # of two answers: a load may change


@pytest.mark.parametrize("wrong", [0.0, 1.38, -0.1])
def test_a_total_of_s_below_that_of_p_is_none(wrong):
    judged = RoundJudge(230.0).judge(good(total_S=wrong), 0)
    assert judged.values["total.S"] is None and judged.values["total.P"] == 1242.0 and judged.flags == {"invalid"}


def swapped(value):
    """A float32 whose words are exchanged."""
    high, low = struct.unpack(">HH", struct.pack(">f", value))
    return struct.unpack(">f", struct.pack(">HH", low, high))[0]


def test_another_word_order_in_a_running_meter_is_no_measurement_and_no_reset():
    judge = RoundJudge(230.0)
    judge.judge(good(), 0)
    for k in range(1, 30):
        values = {name: swapped(value) for name, value in good(total_W=1000.0 + 0.01 * k).items()}
        judged = judge.judge(values, k * SECOND)
        assert not any(value is not None for value in judged.values.values()) and judged.flags == {"invalid"}
    assert judge.judge(good(total_W=1000.3), 30 * SECOND).values["total.W"] == 1000.3


def test_a_phase_without_voltage_that_carries_current_has_no_power():
    dead = {"L2_Vrms": 0.0, "L2_P": 0.0, "L2_S": 0.0, "L2_PF": 0.0, "total_P": 828.0, "total_S": 920.0}
    judged = RoundJudge(230.0).judge(good(**dead), 0)
    assert {name for name, value in judged.values.items() if value is None} == {"L2.Vrms", "L2.P", "L2.S"}
    assert judged.flags == {"invalid"}
    assert not RoundJudge(230.0).judge(good(**dead, L2_Irms=0.0), 0).flags  # a phase that is off
    assert RoundJudge(230.0).judge(good(L1_Irms=9_999.0), 0).values["L1.Irms"] is None


@pytest.mark.parametrize(
    ("power", "rise", "said"),
    [
        (1242.0, 1.0, ""),
        (1242.0, 10.0, "10 times as fast"),
        (1242.0, 1e-3, "0.001 times as fast"),
        (1242.0, 0.0, "stands still"),
        (-1242.0, 1.0, "import rises while P is negative"),
        (-1242.0, 0.0, ""),
    ],
)
def test_an_energy_that_contradicts_the_power_is_said_once(power, rise, said):
    agreement = EnergyAgreement()
    hours = np.arange(0, 50, 1 / 60)
    remarks = [
        agreement.feed({"total.P": power, "total.W": 1000 + 1.242 * rise * h}, round(3600 * h * SECOND)) for h in hours
    ]
    heard = [one for one in remarks if one]
    assert len(heard) == bool(said) and said in "".join(heard)


@pytest.mark.parametrize(
    ("values", "phases", "counted_W", "step_kWh", "unit_kWh"),
    [
        ({"L1.P": -500.0, "L2.P": 700.0, "total.P": 200.0}, 2, 700.0, 0.01, 0.01),  # the register counts each phase
        ({"L1.P": -900.0, "L2.P": 700.0, "total.P": -200.0}, 2, 700.0, 0.01, 0.01),
        ({"total.P": 20.0}, 3, 700.0, 0.01, 0.01),  # so may this one
        ({"total.P": 150.0}, 1, 375.0, 0.01, 0.01),  # rounds in step with a machine
        ({"total.P": 600.0}, 1, 375.0, 0.01, 0.01),
        ({"total.P": 500.0}, 1, 500.0, 10.0, 1.0),
        ({"total.P": 5_000.0}, 1, 5_000.0, 100.0, 100.0),
    ],
)
def test_registers_that_count_otherwise_or_in_large_steps_contradict_nothing(
    values, phases, counted_W, step_kWh, unit_kWh
):
    agreement = EnergyAgreement(unit_kWh, phases)
    for minute in range(60 * 60):
        energy = 1000 + np.floor(counted_W * minute / 6e4 / step_kWh) * step_kWh
        assert not agreement.feed(values | {"total.W": energy}, round(60 * minute * SECOND))


@pytest.mark.parametrize(
    ("change", "null"),
    [
        ({"L1.Irms": 20.0}, {"L1.P", "L1.PF", "L1.Irms"}),
        ({"L1.P": 41.4}, {"L1.P", "L1.PF", "L1.Irms"}),
        ({"L1.PF": 0.09}, {"L1.PF"}),
        ({"L1.Irms": 2.3e-41, "L1.P": 2.5e-41}, {"L1.Irms", "L1.P"}),  # 2.0 and 414.0, with their halves exchanged
        ({"L1.Irms": 7e-45, "L1.P": 1e-30, "L1.PF": 0.0}, set()),  # the filter of a meter at rest
        ({"L1.PF": 0.75}, set()),  # registers of a round differ in time
        ({"L1.P": 150.0}, set()),  # distorted: PF is that of the fundamentals
    ],
)
def test_without_s_the_power_factor_is_held_against_v_x_i(change, null):
    values = {name: value for name, value in good().items() if not name.endswith(".S")}
    judged = RoundJudge(230.0).judge(values | change, SECOND)
    phase = {name for name, value in judged.values.items() if value is None and name.startswith("L1")}
    assert phase == null
