"""Small inputs that misled acqd; their README says what is right."""

from __future__ import annotations

import json

import pytest

from tests.commands import acqd_here
from tests.places import WAVEFORMS

FOLDER = WAVEFORMS.parent / "complaints" / "meter"
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="../shared/data/complaints is absent")
HIGH_VOLTAGE = ("--nominal-voltage", "63500")
THREE_PHASES = ("ll_sel", "ll_both", "vdc_first", "an_bn")
ONE_PHASE = ("date99_mmdd", "date91_ddmm", "rev2000", "frequency_comma")
TABLES = {
    "unit_kv_ma.csv": (), "uptime_ms.csv": ("--rate", "4000"), "time_s_par.csv": (), "tab_comma.txt": (),
    "rigol.csv": ("--map", "u1=CH2,i1=CH4", "--u-scale", "100", "--i-scale", "10"),
    "siglent.csv": ("--map", "u1=CH1,i1=CH2", "--u-scale", "100", "--i-scale", "10"),
    "arecord.wav": ("--u-scale", "1000", "--i-scale", "20"),
}  # fmt: skip


def played(name, *options):
    done = acqd_here("replay", FOLDER / name, *options, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["channels"], done.stderr


@pytest.mark.parametrize("name", THREE_PHASES)
def test_three_phases_of_110_kv(name):
    channels, _ = played(f"{name}.cfg", *HIGH_VOLTAGE)
    assert len(channels) == 3
    for channel in channels:
        assert channel["Vrms"] == pytest.approx(63_508.5, rel=1e-4)
        assert channel["P"] == pytest.approx(5_849_520, rel=1e-4) and channel["W"] > 0


@pytest.mark.parametrize("name", ONE_PHASE)
def test_headers_of_relays(name, tmp_path):
    channels, _ = played(f"{name}.cfg", *HIGH_VOLTAGE, "--out", tmp_path / "r.jsonl")
    assert channels[0]["P"] == pytest.approx(5_849_520, rel=1e-4)
    first = json.loads((tmp_path / "r.jsonl").read_text().splitlines()[0])
    assert first["time"].startswith("2017-05-25T08:13:16.587" if "date" in name else "2026-11-25T08:00:00")


@pytest.mark.parametrize("name", TABLES)
def test_tables_and_a_stream_of_sound(name):
    [channel], said = played(name, *TABLES[name])
    assert channel["Vrms"] == pytest.approx(230, rel=1e-4) and channel["Irms"] == pytest.approx(5, rel=1e-4)
    assert channel["P"] == pytest.approx(1009.22, rel=1e-4)
    assert ("to the end of the file" in said) == (name == "arecord.wav")
    assert ("no date" in said) == (name == "uptime_ms.csv")


def test_inspect_shows_roles_and_what_to_type():
    done = acqd_here("replay", "--inspect", FOLDER / "vdc_first.cfg", FOLDER / "siglent.csv", "--json")
    relay, scope = json.loads(done.stdout)
    roles = {channel["name"]: channel["role"] for channel in relay["channels"]}
    assert (roles["VDC"], roles["VS"], roles["IRES"]) == (
        "DC voltage", "synchronising voltage", "residual or neutral current",
    )  # fmt: skip
    assert relay["map"] == "--map u1=2,i1=6,u2=3,i2=7,u3=4,i3=8" and not relay["refusal"]
    assert "no voltage and current pair" in scope["refusal"] and scope["map"].startswith("--map u1=1,i1=2")
    assert scope["channels"][1]["first"] == [3.25269, 3.24266, 3.21265]
    text = acqd_here("replay", "--inspect", FOLDER / "siglent.csv").stdout
    assert "Siglent CSV export" in text and "cannot be metered as it is" in text
