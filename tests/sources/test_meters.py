"""RMS meters: every profile against an independent register bank, and the bus."""

from __future__ import annotations

import math
import os
import threading
import time

import pytest

from acqd.errors import UserError
from acqd.sources.meters import MeterBus, MeterSettings, Reading, load_profile
from acqd.sources.meters.access import MeterAccess
from acqd.sources.modbus import ModbusLink
from acqd.sources.modbus.client import ModbusClient
from tests.doubles.modbus import ModbusRtuDouble, ModbusTcpDouble
from tests.sources.meter_doubles import MODELS, frozen, meant, read_once
from tests.waiting import wait_for


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
        line = Bus(double.path, units, timeout_s=1.0)
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
        asked, before, noticed = double.requests[7], len(line.rounds()), time.monotonic()
        wait_for(lambda: len(line.rounds()) >= before + 95, "five rounds of the others")
        # The others go on; the dead one is asked ever more rarely, each time for one time-out: pauses double from 1 s.
        assert set(line.rounds()[before:]) == {f"m{unit}" for unit in units if unit != 7}
        assert double.requests[7] - asked <= 2 + math.log2(1 + (time.monotonic() - noticed) / 0.75)
        double.set_silent(False, 7)
        wait_for(lambda: "m7" in line.rounds()[before:], "the meter is back")
        back = next(reading for reading in line.readings[before:] if reading.meter == "m7")
        assert "gap" in back.flags
        line.bus.stop()


def test_a_silent_line_is_opened_again():
    with ModbusRtuDouble({1: frozen("em340")}) as double:
        line = Bus(double.path, range(1, 2), timeout_s=1.0)
        line.bus.check()
        line.bus.start(line.take)
        wait_for(lambda: line.rounds(), "a reading")
        double.refuse(0.5)  # the adapter is unplugged
        wait_for(lambda: line.bus.meters[0].trouble, "trouble is named")
        count = len(line.rounds())
        wait_for(lambda: len(line.rounds()) > count, "readings again")
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


def test_a_silent_serial_line_is_asked_about_its_frames():
    ours, theirs = os.openpty()
    try:
        link = ModbusLink(serial_port=os.ttyname(theirs), baudrate=115_200, timeout_s=0.02)
        with pytest.raises(
            UserError, match=r'no meter answers.*parity, databits, framing \(some lines need "ascii"\) and'
        ):
            MeterBus(link, [MeterSettings("a", "em340")]).check()
    finally:
        os.close(ours)
        os.close(theirs)


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


def test_a_meter_that_asks_for_silence_before_a_request_gets_it():
    with ModbusRtuDouble({1: frozen("sdm630")}) as double:
        client = ModbusClient(ModbusLink(serial_port=double.path, timeout_s=2.0))
        access = MeterAccess(1, load_profile("sdm630"))
        access.read(client)
        begun = time.monotonic()
        access.read(client)
        assert time.monotonic() - begun >= 0.06 * len(access.plan.reads)
        client.close()
