"""The probe of RMS meters, and its command."""

from __future__ import annotations

import signal
import subprocess

import pytest

from acqd.sources.meters.probe import probe
from acqd.sources.modbus import ModbusLink
from tests.commands import acqd, start
from tests.doubles.modbus import ModbusTcpDouble
from tests.sources.meter_doubles import MODELS, frozen
from tests.waiting import LIMIT_S, wait_for


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
    return acqd("modbus", "probe", *words)


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
        place = ("--host", "127.0.0.1", "--port", double.port, "--units", "1-60", "--timeout", "30")
        process = start("modbus", "probe", *place)
        wait_for(lambda: double.requests[1] or double.requests[2], "the probe asks")
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 130 and "Traceback" not in err and "pending" not in err and "RuntimeError" not in err
