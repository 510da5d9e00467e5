"""RMS meters: every profile against an independent register bank, the bus, plausibility, the probe."""

from __future__ import annotations

import signal
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import UserError
from acqd.sources.meters import MeterBus, MeterSettings, Reading, known_profiles, load_profile
from acqd.sources.meters.access import MeterAccess
from acqd.sources.meters.decode import number, quantity
from acqd.sources.meters.plan import make_plan
from acqd.sources.meters.plausible import judge
from acqd.sources.meters.probe import probe
from acqd.sources.meters.profile import FOLDER, NAMES, WIDTH, Register
from acqd.sources.modbus import ModbusLink
from acqd.sources.modbus.client import ModbusClient
from tests.conftest import wait_for
from tests.doubles.modbus import ModbusRtuDouble, ModbusTcpDouble, RmsMeter

MODELS = {"sdm120": "sdm120", "sdm630": "sdm630", "sdm72": "sdm72", "em340": "em340", "b23": "b23",
          "iem3155": "iem3155", "shelly_pro_3em": "pro3em"}  # fmt: skip
"""acqd's profile -> the double's model, whose registers come from another pen."""


def frozen(model: str, **changes: object) -> RmsMeter:
    """A meter whose values do not move, so that a reading can be compared with them."""
    return RmsMeter(model, clock=lambda: 1000.0, **changes)  # type: ignore[arg-type]


def read_once(bank: RmsMeter, profile: str, **changes: object) -> Reading:
    with ModbusTcpDouble({1: bank}) as double:
        meter = MeterSettings("m", profile, unit=1, **changes)  # type: ignore[arg-type]
        bus = MeterBus(ModbusLink("127.0.0.1", double.port, timeout_s=2.0), [meter])
        got: list[Reading] = []
        bus.check()
        bus.start(got.append)
        wait_for(lambda: got, "a reading")
        bus.stop()
    return got[0]


def meant(values: dict[str, float]) -> dict[str, float]:
    """The double's names -> ours."""
    names = {"U": "Vrms", "I": "Irms", "P": "P", "S": "S", "PF": "PF"}
    found = {}
    for key, value in values.items():
        kind, phase = key.rstrip("123"), key[len(key.rstrip("123")) :]
        if key in ("import_kwh", "export_kwh"):
            found["total.W" if key == "import_kwh" else "total.W_export"] = value
        elif key == "f":
            found["f"] = value
        else:
            found[f"{f'L{phase}' if phase else 'total'}.{names[kind]}"] = value
    return found


@pytest.mark.parametrize("profile", MODELS)
def test_a_reading_is_what_the_registers_mean(profile):
    bank = frozen(MODELS[profile])
    reading = read_once(bank, profile)
    expected = meant(bank.values)
    if reading.phases == 1:
        expected = {name.replace("total.W", "L1.W"): value for name, value in expected.items()}
    common = expected.keys() & reading.values.keys()
    assert {f"L{k + 1}.{name}" for k in range(reading.phases) for name in ("Vrms", "Irms", "P")} <= common
    for name in common:
        assert reading.values[name] == pytest.approx(expected[name], rel=1e-6, abs=1e-9), name
    assert reading.flags == {"rms_meter"}


@pytest.mark.parametrize("profile", MODELS)
def test_a_wrong_word_order_is_refused_and_named(profile):
    right = load_profile(profile).quantities["L1.Vrms"].word_order
    wrong = "low" if right == "high" else "high"
    with pytest.raises(UserError, match=rf"make no sense: .*{wrong} word first: set word_order = .{wrong}"):
        read_once(frozen(MODELS[profile], swap_words=True), profile)
    reading = read_once(frozen(MODELS[profile], swap_words=True), profile, word_order=wrong)
    assert reading.values["L1.Vrms"] == pytest.approx(230, rel=0.02)


def test_a_wrong_scale_is_refused_and_named():
    with pytest.raises(UserError, match=r"L1.Vrms = 63\d.* expected 3175 to 9525 V.*voltages and powers times 10"):
        read_once(frozen("sdm630", Vrms=635.0), "sdm630", nominal_voltage=6350.0)


def test_a_meter_that_names_itself_as_another_model_is_refused():
    with pytest.raises(UserError, match=r"identification register holds 341, profile em24_din expects one of"):
        read_once(frozen("em340"), "em24_din")


def test_another_model_is_refused():
    with pytest.raises(UserError, match=r"make no sense|no such register|function code"):
        read_once(frozen("em340"), "sdm630")


def test_a_meter_without_voltage_is_not_judged_and_flagged():
    reading = read_once(frozen("sdm630", Vrms=0.0, Irms=0.0), "sdm630")
    assert "no_mains" in reading.flags


def test_registers_that_a_meter_lacks_are_left_out():
    reading = read_once(frozen("sdm630", faulty={0x48: 2}), "sdm630")
    assert "total.W" not in reading.values and "L1.P" in reading.values
    with pytest.raises(UserError, match="no such register"):
        read_once(frozen("sdm630", faulty={0x00: 2}), "sdm630")


class Bus:
    """Meters on one serial line, polled in real time."""

    def __init__(self, path: str, units: range, profile: str = "em340", **link: object) -> None:
        settings_ = [MeterSettings(f"m{unit}", profile, unit=unit, poll_s=0.05) for unit in units]
        self.bus = MeterBus(ModbusLink(serial_port=path, **link), settings_)  # type: ignore[arg-type]
        self.readings: list[Reading] = []
        self.lock = threading.Lock()

    def take(self, reading: Reading) -> None:
        with self.lock:
            self.readings.append(reading)

    def rounds(self) -> list[str]:
        with self.lock:
            return [reading.meter for reading in self.readings]


def test_twenty_meters_are_read_in_turn_and_a_dead_one_costs_its_time_out_only():
    units = range(1, 21)
    banks = {unit: frozen("em340", Irms=1.0 + unit / 10) for unit in units}
    with ModbusRtuDouble(dict(banks)) as double:
        line = Bus(double.path, units, timeout_s=0.2)
        line.bus.check()
        assert not any(meter.trouble for meter in line.bus.meters)
        line.bus.start(line.take)
        wait_for(lambda: len(line.rounds()) >= 60, "three rounds")
        order = line.rounds()[:20]
        assert sorted(order) == sorted(f"m{unit}" for unit in units)
        for reading in line.readings[:20]:
            assert reading.values["L1.Irms"] == pytest.approx(banks[int(reading.meter[1:])].values["I1"], rel=1e-6)
        double.set_silent(True, 7)
        wait_for(lambda: line.bus.meters[6].trouble, "the dead meter is noticed")
        asked, before = double.requests[7], len(line.rounds())
        wait_for(lambda: len(line.rounds()) >= before + 95, "five rounds of the others")
        # The others go on; the dead one is asked ever more rarely, each time for one time-out.
        assert set(line.rounds()[before:]) == {f"m{unit}" for unit in units if unit != 7}
        assert double.requests[7] - asked <= 4
        double.set_silent(False, 7)
        wait_for(lambda: "m7" in line.rounds()[before:], "the meter is back", 60.0)
        back = next(reading for reading in line.readings[before:] if reading.meter == "m7")
        assert "gap" in back.flags
        line.bus.stop()


def test_a_silent_line_is_opened_again():
    with ModbusRtuDouble({1: frozen("em340")}) as double:
        line = Bus(double.path, range(1, 2), timeout_s=0.1)
        line.bus.check()
        line.bus.start(line.take)
        wait_for(lambda: line.rounds(), "a reading")
        double.refuse(0.5)  # the adapter is unplugged
        wait_for(lambda: line.bus.meters[0].trouble, "trouble is named")
        count = len(line.rounds())
        wait_for(lambda: len(line.rounds()) > count, "readings again", 30.0)
        line.bus.stop()


def test_values_that_never_change_are_flagged_stale():
    with ModbusTcpDouble({1: frozen("em340")}) as double:
        bus = MeterBus(ModbusLink("127.0.0.1", double.port, timeout_s=2.0), [MeterSettings("m", "em340")])
        bus.check()
        [meter], client = bus.meters, bus._client
        flags = [meter.read(client, second * 10**9, time.time_ns).flags for second in (0, 1, 20, 29, 32, 40)]
        assert ["stale" in named for named in flags] == [False, False, False, False, True, True]
        bus.stop()


def test_bad_meters_are_named():
    link = ModbusLink("127.0.0.1", 1)
    with pytest.raises(UserError, match=r"no profile 'sdm999'; known are .*em340"):
        MeterBus(link, [MeterSettings("m", "sdm999")])
    with pytest.raises(UserError, match=r"two meters on 127.0.0.1:1 have the unit id 1"):
        MeterBus(link, [MeterSettings("a", "em340"), MeterSettings("b", "sdm630")])
    with pytest.raises(UserError, match="check wiring"):
        MeterBus(link, [MeterSettings("a", "em340")]).check()


@pytest.mark.parametrize("profile", MODELS)
def test_the_probe_finds_the_profile(profile):
    with ModbusTcpDouble({3: frozen(MODELS[profile])}) as double:
        found = list(probe(ModbusLink("127.0.0.1", double.port, timeout_s=2.0), [2, 3], 230.0, lambda _unit: None))
    assert {one.unit for one in found} == {3}
    best = max(one.rank for one in found)
    names = {one.profile for one in found if one.fits and one.identified is not False}
    assert best[0] and profile in names
    others = names - {"sdm120", "sdm630", "sdm72"} if profile.startswith("sdm") else names - {profile}
    assert not others, "registers of other makers do not make sense by chance"


def test_the_probe_names_the_word_order():
    with ModbusTcpDouble({1: frozen("sdm120", swap_words=True)}) as double:
        found = list(probe(ModbusLink("127.0.0.1", double.port, timeout_s=2.0), [1], 230.0, lambda _unit: None))
    assert not any(one.fits for one in found)
    assert any("low word first" in one.remark for one in found if one.profile == "sdm120")


def command(*words: object) -> subprocess.CompletedProcess[str]:
    arguments = [sys.executable, "-m", "acqd", "modbus", "probe", *map(str, words)]
    return subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=60)


def test_the_command_probe_says_in_one_sentence_what_fits():
    with ModbusTcpDouble({1: frozen("em340"), 2: frozen("em340", swap_words=True)}) as double:
        result = command("--host", "127.0.0.1", "--port", double.port, "--units", "1-2", "--timeout", "2")
        alone = command("--host", "127.0.0.1", "--port", double.port, "--units", "2", "--timeout", "2")
    lines = result.stdout.splitlines()
    assert result.returncode == 0 and "unit 1: profile em340 fits best" in lines
    [second] = [line for line in lines if line.startswith("unit 2")]
    assert "no profile fits as it is; em340:" in second and 'set word_order = "high"' in second
    assert alone.returncode == 1
    gone = command("--host", "127.0.0.1", "--port", double.port)
    assert gone.returncode == 2 and "no connection (Connection refused)" in gone.stderr


def test_breaking_a_probe_off_leaves_no_traceback():
    with ModbusTcpDouble({1: frozen("em340")}) as double:
        double.set_silent(True)
        arguments = ["modbus", "probe", "--host", "127.0.0.1", "--port", str(double.port), "--units", "1-60"]
        process = subprocess.Popen([sys.executable, "-m", "acqd", *arguments], stderr=subprocess.PIPE, text=True)
        wait_for(lambda: double.requests[1] or double.requests[2], "the probe asks")
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=20)
    assert process.returncode == 130 and "Traceback" not in err and "pending" not in err and "RuntimeError" not in err


@pytest.mark.parametrize("name", known_profiles())
def test_every_shipped_profile_is_whole(name):
    profile = load_profile(name)
    assert profile.name == name and profile.source and profile.verified and set(profile.quantities) <= set(NAMES)
    assert {f"L{k + 1}.{kind}" for k in range(profile.phases) for kind in ("Vrms", "Irms")} <= set(profile.quantities)
    assert any(quantity_name.endswith(".W") for quantity_name in profile.quantities)
    for gap in (0, 16):
        plan = make_plan(profile, gap)
        assert all(count <= profile.most_registers for _, _, count in plan.reads)
        answers = [bytes(2 * count) for _, _, count in plan.reads]
        for register in profile.quantities.values():
            assert len(plan.bytes_of(register, answers)) == 2 * register.width


BROKEN = {
    'wordorder = "low"': "unknown key",
    'function = 7\nword_order = "low"': "function is 7",
    'function = 4\nword_order = "middle"': "word_order is 'middle'",
    'function = 4\nword_order = "low"\n[quantities]\n"L1.Q" = { address = 0, type = "u16" }': "L1.Q",
    'function = 4\nword_order = "low"\n[quantities]\n"L1.P" = { address = 0, type = "u17" }': "type is 'u17'",
    'function = 4\nword_order = "low"\n[quantities]\n"L1.P" = { address = 65535, type = "u32" }': "outside",
    'function = 4\nword_order = "low"\n[quantities]\n"L1.P" = { adress = 1, type = "u32" }': "address = NUMBER",
    'function = 4\nword_order = "low"\n[quantities]\n"L1.P" = { address = 1, typ = "u32" }': "unknown key",
    'function = 4\nword_order = "low"\n[quantities]\n"L1.P" = 12': "address = NUMBER",
    "[": "no readable profile",
}


@pytest.mark.parametrize("text", BROKEN)
def test_a_broken_profile_of_ones_own_is_named(text, tmp_path):
    path = tmp_path / "own.toml"
    lines, _, tables = text.partition("\n[quantities]")
    own = 'name = "own"\ntitle = "t"\nsource = "s"\nverified = "v"\n'
    own += 'phases = 1\ntransports = ["rtu"]\nmost_registers = 9\n'
    if "function" not in lines:
        own += 'function = 4\nword_order = "low"\n' if "wordorder" in lines else ""
    tables = tables or '\n"L1.Vrms" = { address = 0, type = "u16" }'
    path.write_text(f"{own}{lines}\n[quantities]{tables}\n")
    with pytest.raises(UserError, match=BROKEN[text]) as caught:
        load_profile(str(path))
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@settings(max_examples=200, deadline=None)
@given(value=st.integers(-(2**31), 2**31 - 1), order=st.sampled_from(["high", "low"]))
def test_word_order_and_type_round_trip(value, order):
    data = struct.pack(">i", value)
    data = data if order == "high" else data[2:] + data[:2]
    assert number(Register(0, "i32", 3, order, 0.5), data) == value * 0.5


@settings(max_examples=200, deadline=None)
@given(data=st.binary(min_size=8, max_size=8), kind=st.sampled_from(sorted(WIDTH)))
def test_any_bytes_give_a_finite_number_or_nothing(data, kind):
    profile = load_profile("em340")
    value = quantity(profile, Register(0, kind, 3, "low"), data[: 2 * WIDTH[kind]])
    assert value is None or (value == value and abs(value) < 1e309)


@pytest.mark.parametrize(
    "changed",
    [
        {"total.S": 364.0, "total.P": -100.0, "L1.P": -2300.0},  # one phase feeds in: vector sums
        {"L2.Vrms": 40.0, "L2.Irms": 0.0, "L2.P": 0.0, "total.P": 4600.0, "total.S": 4600.0},  # an open phase
        {"L1.P": 1430.0, "L1.PF": 0.97},  # a rectifier: PF is cos(phi), the current is distorted
        {"L2.P": -2300.0},  # a reversed current transformer
    ],
)
def test_legitimate_installations_are_not_refused(changed):
    values: dict[str, float | None] = {"f": 50.0, "total.P": 6900.0, "total.S": 6900.0}
    for phase in (1, 2, 3):
        values |= {f"L{phase}.Vrms": 230.0, f"L{phase}.Irms": 10.0, f"L{phase}.P": 2300.0, f"L{phase}.PF": 1.0}
    assert judge(load_profile("em340"), values | changed, 230.0).faults == ()


def test_a_slow_line_has_the_time_that_its_characters_take():
    with ModbusRtuDouble({1: frozen("sdm120")}, baudrate=2400) as double:
        client = ModbusClient(ModbusLink(serial_port=double.path, baudrate=2400))
        assert MeterAccess(1, load_profile("sdm120")).read(client)
        client.close()


def test_stopping_does_not_wait_for_a_round_of_slow_answers():
    with ModbusTcpDouble({1: frozen("em340")}) as double:
        bus = MeterBus(ModbusLink("127.0.0.1", double.port, timeout_s=0.9), [MeterSettings("m", "em340")])
        bus.check()
        bus.start(lambda _reading: None)
        double.set_latency(0.6)
        bus.stop()
        wait_for(lambda: not bus.polling, "the thread ends by itself")


def test_a_power_factor_that_is_not_available_is_no_32_767():
    profile = load_profile("em340")
    assert quantity(profile, profile.quantities["L1.PF"], b"\x7f\xff") is None
    assert quantity(profile, profile.quantities["L1.PF"], (-900).to_bytes(2, "big", signed=True)) == pytest.approx(-0.9)


def test_a_meter_that_asks_for_silence_before_a_request_gets_it():
    with ModbusRtuDouble({1: frozen("sdm630")}) as double:
        client = ModbusClient(ModbusLink(serial_port=double.path, timeout_s=2.0))
        access = MeterAccess(1, load_profile("sdm630"))
        access.read(client)
        begun = time.monotonic()
        access.read(client)
        assert time.monotonic() - begun >= 0.06 * len(access.plan.reads)
        client.close()


def test_plausible_values_of_small_and_reactive_loads_are_not_refused():
    profile = load_profile("em340")
    for amperes, pf in ((0.0, 0.0), (0.004, 1.0), (0.05, 0.2), (60.0, -0.98)):
        values: dict[str, float | None] = {"f": 50.0}
        for phase in (1, 2, 3):
            product = 230.0 * amperes
            values |= {f"L{phase}.Vrms": 230.0, f"L{phase}.Irms": amperes, f"L{phase}.P": round(product * pf, 1),
                       f"L{phase}.S": round(product, 1), f"L{phase}.PF": pf}  # fmt: skip
        assert judge(profile, values, 230.0).faults == (), (amperes, pf)


def test_profiles_are_packaged_beside_the_code():
    assert Path(__file__).parents[2] / "acqd" / "sources" / "meters" / "profiles" == FOLDER
    assert {"sdm120", "sdm630", "sdm72", "em24", "em340", "iem3155", "b23", "shelly_pro_3em"} <= set(known_profiles())
