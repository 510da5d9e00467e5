"""Samples that cannot be those of mains, and wirings that no load has, are said of a recording."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.sources.load import load_waveform
from acqd.sources.recording.wired import wired

RATE, SCALE_V, SCALE_A = 4_000.0, 0.02, 5e-4
T = np.arange(2_400) / RATE
TURNS = 2 * np.pi * (50 * T - np.arange(3)[:, None] / 3)
U, AMP = 325.27 * np.sin(TURNS), 7.0711 * np.sin(TURNS - 0.5)


def recorded(folder, u, i, **more):
    np.savez(folder / "r.npz", u_V=np.atleast_2d(u), i_A=np.atleast_2d(i), fs=RATE, **more)
    return load_waveform(folder / "r.npz")


def codes(folder, u, i):
    u, i = np.rint(u / SCALE_V).astype("<i2"), np.rint(i / SCALE_A).astype("<i2")
    return folder / "r.npz", {"u_code": u, "i_code": i, "u_V_per_digit": SCALE_V, "i_A_per_digit": SCALE_A, "fs": RATE}


def changed(x, phase, change):
    x = x.copy()
    x[phase] = change(x[phase])
    return x


def stretch(x, value):
    """25 ms of `value`, a number or an array."""
    return np.concatenate((x[..., :1_000], np.broadcast_to(value, (*x.shape[:-1], 100)), x[..., 1_100:]), axis=-1)


@pytest.mark.parametrize("channels", [(0,), (0, 1, 2)])
def test_codes_whose_bytes_are_exchanged_are_refused(tmp_path, channels):
    path, arrays = codes(tmp_path, U, AMP)
    for k in channels:
        arrays["i_code"][k] = arrays["i_code"][k].byteswap()
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=r"bytes of each code of i1.*big-endian"):
        load_waveform(path)


@pytest.mark.parametrize(("mask", "high"), [(0x40, True), (0x400, False)])
def test_a_bit_that_never_changes_is_said(tmp_path, mask, high):
    path, arrays = codes(tmp_path, U, AMP)
    arrays["i_code"][1] = arrays["i_code"][1] | mask if high else arrays["i_code"][1] & ~mask
    np.savez(path, **arrays)
    notes = " ".join(load_waveform(path).notes)
    assert (
        f"bit {mask.bit_length() - 1} of the codes of i2 never changes" in notes and notes.count("never changes") == 1
    )


@pytest.mark.parametrize(
    ("u", "i", "said"),
    [
        (np.delete(U, slice(1_000, 1_047), 1), np.delete(AMP, slice(1_000, 1_047), 1), "jump by an angle (-"),
        (
            np.insert(U, [1_000], U[:, 863:1_000], 1),
            np.insert(AMP, [1_000], AMP[:, 863:1_000], 1),
            "jump by an angle (+",
        ),
        (changed(U, 0, lambda x: x * np.where(T < 0.3, 1, 2)), AMP, "u1 goes from 230 V to 460 V at 0.30 s"),
        (stretch(U, 0.0), stretch(AMP, 0.0), "no channel changes for"),
    ],
)
def test_what_does_not_run_on_evenly_is_asked_about(tmp_path, u, i, said):
    assert said in " ".join(recorded(tmp_path, u, i).notes)


@pytest.mark.parametrize(
    ("u", "i"), [(stretch(U, U[:, 990:991]), stretch(AMP, AMP[:, 990:991])), (U, stretch(AMP, 3.0))]
)
def test_a_gap_that_was_filled_with_the_last_value_is_no_measurement(tmp_path, u, i):
    marks = recorded(tmp_path, u, i).marks
    assert marks and all(flags == {"invalid"} for *_, flags in marks)
    assert marks[0][0] <= 1_000 and marks[-1][1] >= 1_100


@pytest.mark.parametrize(
    "i",
    [
        np.maximum(AMP, 0),  # half waves
        np.where(np.abs(np.sin(TURNS)) > 0.7, AMP, 0),  # phase control
        np.full_like(AMP, 5.0),  # a direct current
        np.where(T < 0.3, 5.0, -5.0) * np.ones_like(AMP),  # one that changes its sign
        np.where(T < 0.3, 5.0, 0.0) * np.ones_like(AMP),  # or is switched off
        AMP * np.where(T < 0.3, 1, 3),  # a load that is switched
        np.array([AMP[0], *np.round(0.32 + 0.04 * np.sin(TURNS[1:]), 1)]),  # on one phase; clamps with an offset
        np.round(0.32 + 0.04 * np.sin(TURNS), 1),
        np.sign(AMP),
        np.zeros_like(AMP),
    ],
)
def test_loads_are_no_faults(tmp_path, i):
    dip = U * np.where((T > 0.2) & (T < 0.3), 0.4, 1)
    for u in (U, dip):
        waveform = recorded(tmp_path, u, i)
        assert not waveform.marks and not any("jump" in note or "stay" in note for note in waveform.notes)


@pytest.mark.parametrize(
    ("u", "i", "said"),
    [
        (U, changed(AMP, 0, np.negative), "i1 is reversed"),
        (U, AMP[[1, 0, 2]], "the currents of L1 and L2 are exchanged"),
        (U, AMP[[0, 0, 2]], "i1 and i2 are the same current"),
        (changed(U, 2, lambda x: U[0] - x), AMP, "u3 is 1.73 times the others"),
        (changed(U, 1, lambda x: np.roll(x, 1)), AMP, "u2 is 4.5 degrees late"),
        (np.array([U[0], -U[0]]), np.array([AMP[0], AMP[0]]), "i2 is reversed (unless the load feeds back)"),
    ],
)
def test_the_wiring_of_a_recording_is_named(tmp_path, u, i, said):
    [finding] = wired(recorded(tmp_path, u, i)).findings
    assert said in finding.remedy


@pytest.mark.parametrize(
    ("u", "i"),
    [
        (U, AMP),
        (U[[0, 2, 1]], AMP[[0, 2, 1]]),  # a rotating field to the left
        (U, -325 / 60 * np.sin(TURNS)),  # feeds back
        (U[0], -np.sin(TURNS[0])),
        (U[0], -AMP[0]),  # with reactive power
        (np.array([U[0], -U[0]]), np.array([-AMP[0], AMP[0]])),
        (U[:2], np.sin(TURNS[0] + np.radians(30 - 86)) * np.array([[1], [-1]])),  # an idle motor between two lines
        (U, changed(AMP, 1, lambda x: x / 2)),  # a motor, and single-phase motors on L1 and L3
        (U, changed(AMP, 1, lambda x: x / 1e3)),  # without the first
        (np.array([U[0], -U[0]]), np.array([AMP[0], -0.8 * AMP[0]])),
        (U, changed(325 / 60 * np.sin(TURNS), 0, lambda x: 2 * x)),  # a heater more on L1
        (np.sin(4 * TURNS), np.sin(4 * TURNS)),  # mains at another frequency than said
    ],
)
def test_healthy_wirings_are_not_named(tmp_path, u, i):
    assert wired(recorded(tmp_path, u, i, f_nominal=50.0)).findings == ()
