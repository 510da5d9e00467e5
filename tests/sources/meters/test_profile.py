"""Profiles of RMS meters, shipped and broken, and what their registers mean."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import UserError
from acqd.sources.meters import known_profiles, load_profile
from acqd.sources.meters.decode import number, quantity
from acqd.sources.meters.plan import make_plan
from acqd.sources.meters.profile import FOLDER, NAMES, WIDTH, Register
from tests.places import ROOT


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
    "[": "is not valid TOML",
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


@settings(max_examples=200)
@given(value=st.integers(-(2**31), 2**31 - 1), order=st.sampled_from(["high", "low"]))
def test_word_order_and_type_round_trip(value, order):
    data = struct.pack(">i", value)
    data = data if order == "high" else data[2:] + data[:2]
    assert number(Register(0, "i32", 3, order, 0.5), data) == value * 0.5


@settings(max_examples=200)
@given(data=st.binary(min_size=8, max_size=8), kind=st.sampled_from(sorted(WIDTH)))
def test_any_bytes_give_a_finite_number_or_nothing(data, kind):
    profile = load_profile("em340")
    value = quantity(profile, Register(0, kind, 3, "low"), data[: 2 * WIDTH[kind]])
    assert value is None or (value == value and abs(value) < 1e309)


def test_a_power_factor_that_is_not_available_is_no_32_767():
    profile = load_profile("em340")
    assert quantity(profile, profile.quantities["L1.PF"], b"\x7f\xff") is None
    assert quantity(profile, profile.quantities["L1.PF"], (-900).to_bytes(2, "big", signed=True)) == pytest.approx(-0.9)


def test_profiles_are_packaged_beside_the_code():
    assert ROOT / "acqd" / "sources" / "meters" / "profiles" == FOLDER
    assert {"sdm120", "sdm630", "sdm72", "em24", "em340", "iem3155", "b23", "shelly_pro_3em"} <= set(known_profiles())
