"""What only several rounds of a meter show: registers that leave the others, other units, wrong ratios."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.sources.meters import load_profile
from acqd.sources.meters.line_voltage import LineVoltage
from acqd.sources.meters.plan import make_plan
from acqd.sources.meters.plausible import explain
from acqd.sources.meters.rated import RatedCurrent
from acqd.sources.meters.resolution import Resolution
from acqd.sources.meters.rounds import RoundJudge
from tests.sources.meters.test_rounds import SECOND, good, without

SQRT3 = 3**0.5


def voltages(factor, values):
    return {name: value * factor if name.endswith(".Vrms") else value for name, value in values.items()}


def after_a_round(values):
    judge = RoundJudge(230.0)
    for k in range(2):
        first = {name: value for name, value in good().items() if name in values}
        assert not judge.judge(first, k * SECOND).flags
    return judge.judge(values, 2 * SECOND), judge


@pytest.mark.parametrize("missing", [(), ("S",), ("PF",), ("S", "PF")])
@pytest.mark.parametrize("phases", [1, 3])
def test_voltages_between_lines_are_no_phase_voltages(missing, phases):
    names = {f"L{k}" for k in range(1, phases + 1)} | {"f"}
    values = {name: value for name, value in without(good(), *missing).items() if name.partition(".")[0] in names}
    judged, judge = after_a_round(voltages(SQRT3, values))
    assert {name for name, value in judged.values.items() if value is None} == {
        f"L{k}.Vrms" for k in range(1, phases + 1)
    }
    assert judged.flags == {"invalid"}
    assert not judge.judge(values, 3 * SECOND).flags


@pytest.mark.parametrize(
    ("wrong", "null"),
    [({"L1.Vrms": 294.0}, "L1.Vrms"), ({"L1.Irms": 3.5}, "L1.Irms"), ({"L1.S": 724.0}, "L1.S"),
     ({"L2.P": 208.0}, "L2.P"), ({"L3.PF": 0.4}, "L3.PF"), ({"total.P": 2484.0}, "total.P"), ({"f": 60.0}, "f")],
)  # fmt: skip
def test_a_register_cannot_leave_the_others_alone(wrong, null):
    judged, judge = after_a_round(good() | wrong)
    assert {name for name, value in judged.values.items() if value is None} == {null} and "invalid" in judged.flags
    assert judge.contradicts(good() | wrong, 3 * SECOND) and not judge.contradicts(good(), 3 * SECOND)
    assert not judge.judge(good(), 3 * SECOND).flags


@pytest.mark.parametrize("missing", [("S",), ("PF",), ("S", "PF")])
def test_a_voltage_that_is_wrong_is_so_at_other_loads(missing):
    values = {name: value for name, value in without(good(), *missing).items() if name.startswith("L1")}
    _, judge = after_a_round(values)
    loads = [1.0, 1.01, 2.0, 0.5] if missing != ("S", "PF") else [1.0, 1.01]
    for k, load in enumerate(loads, start=3):
        changed = {n: v * load if n.endswith((".Irms", ".P", ".S")) else v for n, v in voltages(1.3, values).items()}
        assert judge.judge(changed, k * SECOND).values["L1.Vrms"] is None, load


def test_loads_mains_and_another_supply_are_believed():
    for changes in (
        {"L1.Irms": 4.0, "L1.P": 828.0, "L1.S": 920.0, "total.P": 1656.0, "total.S": 1840.0},  # a load
        {"L1.Irms": 4.0, "L1.S": 920.0, "L1.PF": 0.45, "total.S": 1840.0},  # a reactive one
        {"L1.Vrms": 120.0, "L1.Irms": 3.83},  # a dip, at constant power
        {"L1.P": -414.0, "total.P": 414.0},  # returns what it has drawn
        {"L1.Vrms": 398.0, "L1.S": 796.0, "L1.P": 716.0, "total.P": 1544.0, "total.S": 1716.0},  # the neutral is lost
        {"L1.Vrms": 251.0},  # EN 50160, S of a moment ago
    ):
        judged, _ = after_a_round(good() | changes)
        assert not judged.flags, changes
    _, judge = after_a_round(good())
    flags = [judge.judge(good() | {"f": 60.0}, k * SECOND).flags for k in range(3, 20)]
    assert flags[0] == {"invalid"} and not flags[-1]


def test_a_wrong_first_round_does_not_make_the_right_ones_wrong():
    first = without(good(), "S", "PF") | {"L1.Vrms": 115.0}
    judge = RoundJudge(230.0)
    judge.judge(first, 0)
    assert judge.judge(without(good(), "S", "PF"), SECOND).values["L1.Vrms"] == 230.0


@pytest.mark.parametrize("step_s", [4])
@pytest.mark.parametrize(("times", "wrong"), [(1.0, False), (30.0, False), (1000.0, True)])
def test_an_energy_that_no_load_reaches_counts_in_another_unit(times, wrong, step_s):
    judge = RoundJudge(230.0)
    energies = ((k, 1000 + times * 1.242 * k / 3600) for k in range(0, 4000, step_s))
    flags = [judge.judge(good() | {"total.W": W}, k * SECOND).flags for k, W in energies]
    assert ("invalid" in flags[-1]) == wrong == judge.too_fast
    assert sum("meter_reset" in one for one in flags) <= wrong and sum(map(bool, flags)) >= wrong * 0.98 * len(flags)


def rounds(share, currents, **missing):
    for current in currents:
        yield {"L1.Vrms": 208.0, "L1.Irms": current, "L1.S": 208.0 * current / share, "L1.P": 100.0} | missing


def test_only_a_share_that_no_load_changes_proves_voltages_between_lines():
    steps = np.linspace(2.0, 4.0, 40)
    proof = LineVoltage()
    assert sum(proof.feed(values) for values in rounds(SQRT3, steps)) == 1 and proof.proven
    assert proof.feed(next(rounds(1.0, [3.0]))) is False and not proof.proven
    for share, currents in ((1.0, steps), (SQRT3, np.full(40, 3.0)), (SQRT3, steps / 10), (1.6, steps)):
        proof = LineVoltage()
        assert not any(proof.feed(values) for values in rounds(share, currents))
    distorted = [
        next(rounds(share, [current])) for share, current in zip(np.linspace(1.85, 1.6, 40), steps, strict=True)
    ]
    assert not any(map(LineVoltage().feed, distorted))


@pytest.mark.parametrize(
    ("rated", "amperes", "seconds", "said"),
    [(16.0, 16.0, 7300, ""), (16.0, 25.0, 7300, ""), (16.0, 26.0, 3700, "60 minutes"), (16.0, 66.0, 130, "2 minutes"),
     (16.0, 330.0, 1, "now"), (16.0, 100.0, 60, ""), (10.0, 18.0, 3700, ""), (2.0, 4.1, 3700, ""),
     (100.0, 165.0, 3700, ""), (100.0, 165.0, 7300, "120 minutes")],
)  # fmt: skip
def test_a_fuse_tells_a_ratio_that_is_too_large(rated, amperes, seconds, said):
    watch = RatedCurrent(rated)
    remarks = [watch.feed({"L1.Irms": amperes}, k * SECOND) for k in range(0, seconds + 1, 10)]
    assert [one for one in remarks if one] == ([watch.remark] if said else []) and said in watch.remark
    assert not RatedCurrent(None).feed({"L1.Irms": 1e6}, 0)


def test_advice_names_exchanged_bytes_and_voltages_between_lines():
    import struct

    profile = load_profile("sdm120")
    plan = make_plan(profile)
    values = {"L1.Vrms": 230.0, "L1.Irms": 2.0, "L1.P": 414.0, "L1.S": 460.0, "L1.PF": 0.9, "f": 50.0}

    def answers(values):
        memory = bytearray(2 * 128)
        for name, register in profile.quantities.items():
            memory[2 * register.address : 2 * register.address + 4] = struct.pack(">f", values.get(name, 100.0))
        return [bytes(memory[2 * at : 2 * (at + count)]) for _, at, count in plan.reads]

    odd = [bytes(byte for k in range(0, len(one), 2) for byte in (one[k + 1], one[k])) for one in answers(values)]
    assert "bytes of each register" in explain(profile, plan, odd, 230.0)
    assert "sqrt(3)" in explain(profile, plan, answers(values | {"L1.Vrms": 398.4}), 230.0)


def reactive(PF=0.0, **changes):
    """A transformer without load, of a meter that shows PF to 0.01."""
    return {"L1.Vrms": 230.1, "L1.Irms": 2.61, "L1.S": 600.6, "L1.PF": PF, "f": 50.0} | changes


def test_the_power_of_a_reactive_load_is_its_own():
    judge = RoundJudge(230.0)
    for k, P in enumerate((5.0, -3.0, 14.0, 2.0, 9.0, -6.0)):
        assert not judge.judge(reactive() | {"L1.P": P}, k * SECOND).flags
    assert judge.judge(reactive() | {"L1.P": 500.0}, 7 * SECOND).flags


def test_a_step_of_a_coarse_register_is_no_contradiction():
    judge, found = RoundJudge(230.0), []
    for k, kW in enumerate((0.1, 0.2, 0.3, 0.2, 0.1, 0.2, 0.1, 0.1, 0.2)):
        shown = {"L1.P": 1000 * kW, "L1.S": 250.0, "L1.PF": 0.7, "L1.Irms": 1.09, "L1.Vrms": 230.0}
        found.append(judge.judge(shown, k * SECOND).flags)
    assert not any(found[3:])  # the step is known


def test_f_of_a_generator_that_runs_up_is_believed():
    judge = RoundJudge(230.0)
    for k in range(9):
        shown = good() | {"f": 41.0 + k} | {f"L{j}.Vrms": 160.0 + 8 * k for j in (1, 2, 3)}
        shown |= {f"L{j}.{kind}": 0.0 for j in (1, 2, 3) for kind in ("Irms", "P", "S", "PF")}
        shown |= {"total.P": 0.0, "total.S": 0.0, "total.PF": 0.0}
        assert judge.judge(shown, k * SECOND).values["f"] == shown["f"], k


@pytest.mark.parametrize("value", [0.1, 1.0, 10.0])
def test_the_resolution_of_a_register_is_that_of_its_values(value):
    resolution = Resolution()
    for k in (3, 3, 14):
        resolution.feed(float(np.float32(k * value)))
        assert resolution.step == 0
    resolution.feed(float(np.float32(7 * value)))
    assert resolution.step == pytest.approx(value)
    resolution.feed(value / 8)
    assert resolution.step < value / 8


def test_a_meter_that_has_only_totals_counts_what_its_power_makes():
    judge = RoundJudge(230.0)
    for k in range(0, 3000, 10):
        shown = {"total.P": 150_000.0, "total.W": round(5000 + 150 * k / 3600, 2)}
        assert not judge.judge(shown, k * SECOND).flags, k


@pytest.mark.parametrize("step", [0.1, 1.0])
def test_a_counter_that_rises_in_large_steps_is_believed(step):
    judge, seen = RoundJudge(230.0), []
    for k in range(0, 3700, 5):
        energy = 123_450 + 50 * k / 3600  # 50 kW
        shown = good() | {f"L{j}.{kind}": 16_700.0 for j in (1, 2, 3) for kind in ("P", "S")} | {"total.S": 50_100.0}
        shown |= {f"L{j}.Irms": 72.6 for j in (1, 2, 3)} | {f"L{j}.PF": 1.0 for j in (1, 2, 3)}
        shown |= {"total.P": 50_100.0, "total.PF": 1.0, "total.W": step * (energy // step)}
        judged = judge.judge(shown, k * SECOND)
        seen += [judged.values["total.W"]]
        assert not judged.flags & {"meter_reset"} and not judge.too_fast
    assert None not in seen[1:] and seen[-1] == shown["total.W"]
