"""Wiring of three phases from phasors."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from acqd.daemon.correction_section import CorrectionSection
from acqd.metering.phasors import Phasors, phasors
from acqd.metering.wiring_check import examine
from acqd.sources import load_waveform
from acqd.sources.recording.wired import wired

TURN = np.exp(-2j * np.pi * np.arange(3) / 3)
SIGNS = [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)]
PF = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0)


def site(random, pf, order=(0, 1, 2), sign=(1, 1, 1), unbalance=0.0):
    """Phasors as measured, and the true power."""
    U = 230 * TURN * (1 + random.normal(0, 0.01, 3))
    lag = np.arccos(pf) + random.normal(0, np.radians(1 + 4 * unbalance), 3)
    I = 5 * TURN * np.exp(-1j * lag) * (1 + unbalance * random.uniform(-1, 1, 3))  # noqa: E741
    measured = np.zeros(3, complex)
    for k in range(3):
        measured[order[k]] = I[k] * sign[k]
    return Phasors(U, measured), float((U * I.conj()).real.sum())


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("unbalance", [0.0, 0.3])
def test_permutations_and_reversals_are_named(known, unbalance):
    random, right, cases = np.random.default_rng(0), 0, 0
    for pf in PF:
        for order in permutations(range(3)):
            for sign in SIGNS:
                found, power = site(random, pf, order, sign, unbalance)
                named = [(one.order, one.sign) for one in examine(found, power if known else None)]
                plain = order == (0, 1, 2) and sign == (1, 1, 1)
                right += named == ([] if plain else [(tuple(k + 1 for k in order), sign)])
                cases += 1
    assert right >= 0.97 * cases


def test_healthy_sites_are_never_warned_of():
    random = np.random.default_rng(1)
    for _ in range(150):
        found, power = site(random, random.uniform(0.2, 1), unbalance=random.uniform(0, 0.5))
        assert examine(found) == [] == examine(found, power)
        U = 230 * TURN
        lag = np.radians(random.uniform(-30, 70, 3))  # three single-phase loads
        single = Phasors(U, random.uniform(0.2, 5, 3) * TURN * np.exp(-1j * lag))
        assert examine(single) == []
    feeding = Phasors(230 * TURN, -5 * TURN * np.exp(-0.05j))
    left = Phasors(230 * TURN.conj(), 5 * TURN.conj() * np.exp(-0.5j))
    idle = Phasors(230 * TURN, np.array([5, 0.01, 0.01]) * -TURN)
    one_phase = Phasors(np.array([230 + 0j]), np.array([-5 + 0j]))
    for found in (feeding, left, idle, one_phase):
        assert examine(found) == []


@pytest.mark.parametrize(
    ("change", "text"),
    [(lambda U: U * [1, 0.04, 1], "u2 missing or floating"), (lambda U: np.array([U[0], U[0], U[2]]), "u1 and u2 are the same"),  # noqa: E501
     (lambda U: U * [1, -1, 1], "u2 is reversed"), (lambda U: U * [-1, 1, 1], "u1 is reversed"),
     (lambda U: U * [1, 1, 10], "times the others (230"), (lambda U: U * [1, 1.732, 1], "voltage between lines")],
)  # fmt: skip
def test_voltages_are_judged_first(change, text):
    found, _ = site(np.random.default_rng(2), 0.9)
    [finding] = examine(Phasors(change(found.U), found.I))
    assert text in finding.text


def test_a_reversed_transformer_of_a_single_phase_load_is_named():
    lag = np.radians([10.0, 60.0, 35.0])
    I = np.array([5, -1, 3]) * TURN * np.exp(-1j * lag)  # noqa: E741
    assert "i2 is reversed" in examine(Phasors(230 * TURN, I))[0].text


@pytest.mark.parametrize("lag", [20.0, 35.0, 50.0, 70.0])
def test_three_reversed_transformers_are_never_hidden_by_another_wiring(lag):
    I = -5 * TURN * np.exp(-1j * np.radians(lag))  # noqa: E741
    found = Phasors(230 * TURN, I)
    [finding] = examine(found)
    assert "i1 and i2 and i3 are reversed" in finding.text or "or all three currents are reversed" in finding.text
    [known] = examine(found, 3 * 230 * 5 * np.cos(np.radians(lag)))
    assert known.sign == (-1, -1, -1) and "or" not in known.text.split()


def test_phasors_of_samples_are_those_of_the_wave():
    t = np.arange(40_000) / 20_000
    angle = 2 * np.pi * 50.07 * t  # nominal 50 Hz: the pieces are turned
    wave = [f(angle + shift) for shift in (0.3, 0.3 - 2 * np.pi / 3, 0.3 + 2 * np.pi / 3) for f in
            (lambda a: 325 * np.cos(a) + 9, lambda a: 7 * np.cos(a - 0.5) + np.cos(3 * a))]  # fmt: skip
    found = phasors(np.column_stack(wave), 20_000.0, 50.0)
    np.testing.assert_allclose(found.angles_deg(), np.degrees([0.5] * 3), atol=0.2)
    np.testing.assert_allclose(np.abs(found.U), [325 / np.sqrt(2)] * 3, rtol=1e-3)


def test_no_recording_is_warned_of(waveforms):
    paths = [*waveforms.glob("*/*.npz"), waveforms / "generator_3ph/source/test3.cfg"]
    assert len(paths) > 4
    for path in paths:
        waveform = load_waveform(path)
        values = waveform.codes * np.array(waveform.form.scale)
        assert examine(phasors(values, waveform.form.rate, waveform.form.f_nominal)) == [], path
        assert wired(waveform).findings == () and not any("jump" in note for note in waveform.notes), path


RATIOS = [0.1, 0.2, 1 / 3, 0.5, 2, 3, 5, 10, 20, 40, 100]


@pytest.mark.parametrize("known", [0.97, 1.0, 1.03])
def test_a_wrong_ratio_is_named_where_the_power_of_the_load_is_known(known):
    random, right, cases = np.random.default_rng(2), 0, 0
    for ratio in RATIOS:
        for pf in PF:
            found, power = site(random, pf, unbalance=0.2)
            said = examine(Phasors(found.U, found.I * ratio), known * power)
            right += [one.gain for one in said] == [pytest.approx((1 / ratio,) * 3, rel=1e-3)]
            assert all(one.gain for one in said), (ratio, pf, said)  # never another mistake
            cases += 1
    assert right >= 0.9 * cases


def test_a_wrong_ratio_has_a_correction_to_paste():
    found, power = site(np.random.default_rng(3), 0.8)
    [said] = examine(Phasors(found.U, 10 * found.I), power)
    assert "the currents are 10 times too large (ratio of the transformers" in said.text
    assert said.correction == "[source] correction = { i_gain = [0.1, 0.1, 0.1] }"
    section = CorrectionSection(i_gain=[1.0, 1.002, 1.0])
    assert "i_gain = [0.1, 0.1002, 0.1]" in section.after(said)
    [said] = examine(Phasors(found.U, found.I * [1, 4, 1]), power)
    assert said.correction == "[source] correction = { i_gain = [1.0, 0.25, 1.0] }" and "i2 is 4 times too" in said.text
    [said] = examine(Phasors(found.U, 5 * found.I * [1, -1, 1]), power)  # and a reversed transformer
    assert said.correction == "[source] correction = { i_gain = [0.2, -0.2, 0.2] }"
    assert not examine(Phasors(found.U, 1.5 * found.I), power)  # a load may be that far from its model
    assert not examine(Phasors(found.U, 2.25 * found.I), power / 0.97)


def test_more_than_the_nameplate_allows_is_named():
    found, power = site(np.random.default_rng(4), 0.8)
    [said] = examine(Phasors(found.U, 10 * found.I), rated_W=1.4 * power)
    assert "more than the" in said.text and said.correction == "[source] correction = { i_gain = [0.1, 0.1, 0.1] }"
    assert not examine(found, rated_W=1.4 * power) and not examine(found, rated_W=0.7 * power)
