"""Voltages between lines as star voltages, through the command."""

from __future__ import annotations

import json

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.sources import ChannelMap, load_waveform
from tests.commands import acqd_here

T = np.arange(2_000) / 5_000.0
E = np.exp(2j * np.pi * np.arange(3) / -3)
U = np.real(400 / np.sqrt(3) * np.sqrt(2) * E[None, :] * np.exp(2j * np.pi * 50 * T[:, None]))
I = np.real(np.array([10, 8, 6]) * np.sqrt(2) * E[None, :] * np.exp(2j * np.pi * 50 * T[:, None] - 0.5j))  # noqa: E741
I[:, 2] = -I[:, 0] - I[:, 1]
LINES = {"VAB": U[:, 0] - U[:, 1], "VBC": U[:, 1] - U[:, 2], "VCA": U[:, 2] - U[:, 0], "VAC": U[:, 0] - U[:, 2]}
POWER = float((U * I).sum(axis=1).mean())


def write(path, names, currents=I):
    table = np.column_stack([T, *(LINES[name] for name in names), currents])
    lines = [",".join(f"{value:.9g}" for value in row) for row in table]
    path.write_text(
        "\n".join([",".join(["time [s]", *(f"{n} [V]" for n in names), "IA [A]", "IB [A]", "IC [A]"]), *lines])
    )
    return path


@pytest.mark.parametrize("names", [("VAB", "VBC", "VCA"), ("VAB", "VBC", "VAC"), ("VAB", "VBC"), ("VAC", "VBC", "VAB")])
def test_the_power_is_that_of_the_wattmeters_and_rows_are_flagged(tmp_path, names):
    path = write(tmp_path / "a.csv", names)
    done = acqd_here("replay", path, "--out", "r.jsonl", "--json", cwd=tmp_path)
    assert done.returncode == 0 and "are voltages between lines" in done.stderr
    rows = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    total = [row["P"] for row in rows if row["channel"] == "total"]
    assert total[-1] == pytest.approx(POWER, rel=1e-3) and all("derived" in row["flags"] for row in rows)


@pytest.mark.parametrize("names", [{"u1": "Nosuch"}, {"u1": "VAB", "i1": "Nosuch"}, {"u12": "VAB", "u23": "Nosuch"}])
def test_a_channel_of_the_map_that_is_not_there_is_named(tmp_path, names):
    with pytest.raises(InputError, match="has no column 'Nosuch'; columns are 0=time"):
        load_waveform(write(tmp_path / "a.csv", ("VAB", "VBC", "VCA")), ChannelMap(names))


def test_currents_in_a_neutral_and_open_loops_are_refused(tmp_path):
    shifted = I + 0.5
    with pytest.raises(InputError, match="power needs the voltages to neutral"):
        load_waveform(write(tmp_path / "a.csv", ("VAB", "VBC", "VCA"), shifted))
    path = write(tmp_path / "b.csv", ("VAB", "VBC", "VAC"))
    path.write_text(path.read_text().replace("VAC [V]", "VCA [V]"))
    with pytest.raises(InputError, match="do not close the loop"):
        load_waveform(path)
    names = {"u12": "VAB", "u23": "VBC", "u13": "VCA", "i1": "IA", "i2": "IB", "i3": "IC"}
    assert load_waveform(path, ChannelMap(names)).flags == {"derived"}
    with pytest.raises(InputError, match=r"two or three of them and three currents"):
        load_waveform(path, ChannelMap({"u12": "VAB", "i1": "IA"}))


def test_a_direct_voltage_that_is_named_like_a_phase_is_refused(tmp_path):
    table = np.column_stack([T, U[:, 0], U[:, 1], np.full(len(T), 110.0), I])
    rows = [",".join(f"{value:.9g}" for value in row) for row in table]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["time,u1,u2,u3,i1,i2,i3", *rows]))
    with pytest.raises(InputError, match="'u3' for u3 is a direct voltage"):
        load_waveform(path)
