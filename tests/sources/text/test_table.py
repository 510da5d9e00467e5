"""CSV files, good and broken."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.sources import ChannelMap, load_waveform
from acqd.sources.text.table import is_number, split_row
from tests.mains import make_mains
from tests.sources.files import write_csv


def test_a_row_with_a_field_that_is_longer_than_csv_reads_is_split():
    assert [len(field) for field in split_row(f'1,"{"a" * 140_000}"', ",")] == [1, 140_000]


def test_csv_gives_the_values_it_holds(tmp_path):
    mains = write_csv(tmp_path / "a.csv")
    waveform = load_waveform(tmp_path / "a.csv")
    assert waveform.form.rate == pytest.approx(10_000, rel=1e-6) and waveform.start_utc_ns is None
    batch = Meter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0))
    assert batch.Vrms[0, -1] == pytest.approx(mains.Vrms, rel=2e-4)
    assert batch.P[0, -1] == pytest.approx(mains.P, rel=4e-4)


def test_csv_with_semicolons_decimal_commas_and_unix_time(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, t0=1_700_000_000.0, delimiter=";")
    path.write_text(path.read_text().replace(".", ","))
    waveform = load_waveform(path)
    assert waveform.start_utc_ns == 1_700_000_000_000_000_000
    assert waveform.form.rate == pytest.approx(10_000, rel=1e-4)


def test_row_names_of_r_are_no_column_of_the_header(tmp_path):
    """The header has a name less than the rows have fields: the names would stand one column too far left."""
    plain, named = tmp_path / "a.csv", tmp_path / "r.csv"
    write_csv(plain)
    header, *rows = plain.read_text().splitlines()
    named.write_text("\n".join([header, *(f'"{number}",{row}' for number, row in enumerate(rows, start=1))]))
    np.testing.assert_array_equal(load_waveform(named).codes, load_waveform(plain).codes)


def test_csv_columns_by_map_and_scale(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, header="t,Ch A,Ch B")
    waveform = load_waveform(path, ChannelMap({"u1": "Ch A", "i1": "Ch B"}, u_scale=100.0, i_scale=10.0))
    plain = load_waveform(path, ChannelMap({"u1": "1", "i1": "2"}))
    assert waveform.form.scale[0] == pytest.approx(100 * plain.form.scale[0])
    assert waveform.form.scale[1] == pytest.approx(10 * plain.form.scale[1])


def test_physical_values_keep_their_precision(tmp_path):
    """As exact as the codes, also the quiet minutes of a recording with a peak of 3 kA."""
    mains = make_mains(50.0, seconds=1.0, phases=1)
    mains.codes[:800, 1] = 32_000
    scale = np.array((mains.scale[0], 0.1))
    t = np.arange(len(mains.codes)) / mains.rate
    rows = [",".join(map(repr, row)) for row in np.column_stack((t, mains.codes * scale)).tolist()]
    (tmp_path / "a.csv").write_text("\n".join(["time,u1,i1", *rows]))
    waveform = load_waveform(tmp_path / "a.csv")
    truth = Meter(StreamFormat(mains.rate, tuple(scale)), mode="fixed").feed(SampleBlock(mains.codes, 0, 0))
    batch = Meter(waveform.form, mode="fixed").feed(SampleBlock(waveform.codes, 0, 0))
    for name in ("Vrms", "Irms", "P", "W"):
        np.testing.assert_allclose(getattr(batch, name), getattr(truth, name), rtol=1e-9, atol=1e-9)


def test_headers_in_latin_1(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, header="time,U_Küche,I_Küche")
    path.write_bytes(path.read_text().encode("latin-1"))
    assert load_waveform(path, ChannelMap({"u1": "U_Küche", "i1": "I_Küche"})).form.phases == 1
    text = path.read_text("latin-1")
    path.write_bytes(text.encode("utf-16"))
    assert load_waveform(path, ChannelMap({"u1": "1", "i1": "2"})).form.phases == 1  # its first two bytes say so
    path.write_bytes(text.encode("utf-16-le"))
    with pytest.raises(InputError, match="--encoding utf-16"):
        load_waveform(path)
    assert load_waveform(path, ChannelMap({"u1": "1", "i1": "2"}, encoding="utf-16-le")).form.phases == 1


@pytest.mark.parametrize("header", ["time,u1,i1,u1,i1", "time,u,i,v1,x"])
def test_two_columns_for_one_quantity_are_refused(tmp_path, header):
    path = tmp_path / "a.csv"
    rows = [f"{k / 2e4},1,2,3,4" for k in range(2_000)]
    path.write_text("\n".join([header, *rows]))
    with pytest.raises(InputError, match=r"two columns for u1.*columns: 0=time, 1=u"):
        load_waveform(path)
    assert load_waveform(path, ChannelMap({"u1": "1", "i1": "2"})).codes[0].tolist() == [1, 2]


@pytest.mark.parametrize("columns", [{"u1": "u1", "i1": "u1"}, {"u1": "0", "i1": "1", "u2": "2", "i2": "1"}])
def test_a_column_is_one_current_only(tmp_path, columns):
    write_csv(tmp_path / "a.csv")
    with pytest.raises(InputError, match="expected another column for each"):
        load_waveform(tmp_path / "a.csv", ChannelMap(columns))


def test_a_key_of_a_map_stands_once():
    with pytest.raises(UserError, match=r"u1 stands twice \(A and B\)"):
        ChannelMap.parse("u1=A,i1=C,u1=B")


def test_a_map_to_equal_names_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,A,A\n0,1,2\n0.0001,1,2\n")
    with pytest.raises(InputError, match=r"2 columns with the name 'A'.*0=time, 1=A, 2=A"):
        load_waveform(path, ChannelMap({"u1": "A", "i1": "A"}))


def test_memory_is_bounded_by_the_size_of_the_file(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path, rows=50_000)
    tracemalloc.start()
    load_waveform(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3 * path.stat().st_size


BROKEN_CSV = {
    "time,u1,i1\n0,1,2\n0.0001,x,2\n": "row 3, column 2: 'x' is not a number",
    "time,u1,i1\n0,1,2\n0.0001,1\n": "row 3 has 2 columns, expected 3",
    "time,u1,i1\n0,1,2\n0.0001,nan,2\n": "row 3, column 2",
    "time,u1,i1\n": "no samples",
    "time,u1\n0,1\n0.1,2\n": "u1 but no i1",
    "time,a,b\n0,1,2\n": "no voltage and current",
    "0,1,2\n0.0001,1,2\n": "row 1 has no names",
    "u1,i1\n1,2\n": "--rate",
    "time,u1,i1\n0,1,2\n0,1,2\n": "does not advance",
    "time,u1,i1\n0,1,2\n0.0001,1,2\n0.0005,1,2\n0.0006,1,1\n": "equidistant",
    "time,u1,i1\n0,1,2\n0.01,1,2\n0.02,1,2\n": "200 Hz",
}


@pytest.mark.parametrize("text", BROKEN_CSV)
def test_broken_csv_is_named_with_its_row(tmp_path, text):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=BROKEN_CSV[text]):
        load_waveform(path)


def test_a_hole_in_a_csv_is_a_gap_and_named(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:2_001] + lines[2_501:]))
    waveform = load_waveform(path)
    assert waveform.breaks == ((2_000, 500),)
    assert any("pause 1 time (first before sample 2001" in note for note in waveform.notes)


def test_rows_that_are_missing_everywhere_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    write_csv(path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(line for k, line in enumerate(lines) if k % 20 != 7))
    with pytest.raises(InputError, match="equidistant"):
        load_waveform(path)


@pytest.mark.parametrize(
    ("names", "refused"), [("u1,i1", True), ("u1 [V],i1 [mA]", False), ("u1,i1 [A]", False), ("Volts,Amps", False)]
)
def test_whole_numbers_without_a_unit_may_be_codes(tmp_path, names, refused):
    rows = [f"{t:.6f},{np.rint(1_300 * np.cos(314 * t)):.0f},{np.rint(700 * np.cos(314 * t)):.0f}" for t in T]
    path = written(tmp_path, [f"time [s],{names}"], rows)
    if refused:
        with pytest.raises(InputError, match="codes of a converter or mV"):
            load_waveform(path)
    assert load_waveform(path, ChannelMap(u_scale=0.25, i_scale=0.01) if refused else None)


def test_a_field_of_many_digits_is_looked_through_once():
    digits = "9" * 200_000  # a search that goes back from every digit takes minutes
    assert is_number(digits, ".") and is_number(digits + ".5e3", ".") and is_number(f"-{digits},", ",")
    assert not is_number(digits + "x", ".") and not is_number(digits + ",1", ".")


def written(folder, head, rows, encoding="utf-8"):
    path = folder / "a.csv"
    path.write_text("\n".join([*head, *rows]) + "\n", encoding=encoding)
    return path


T = np.arange(1_000) / 4_000
VOLTS, AMPERES = 325.27 * np.sin(314.159 * T), 7.0711 * np.sin(314.159 * T - 0.5)
PLAIN = [f"{t:.5f},{u:.4f},{i:.4f}" for t, u, i in zip(T, VOLTS, AMPERES, strict=True)]
GERMAN = [row.replace(",", ";").replace(".", ",") for row in PLAIN]
STAMPED = [f"2024/03/01 10:00:00,{row.partition(',')[2]}" for row in PLAIN]


@pytest.mark.parametrize(
    ("head", "rows"),
    [
        (["Zeit;U_L1;I_L1", "s;V;A"], GERMAN),
        (["Zeit;U_L1;I_L1", ";V;A"], GERMAN),  # no unit of the time: nothing moves to the left
        (["sep=;", "time [s];U_L1 [V];I_L1 [A]"], GERMAN),
        (["Rate,4000", "Trace,U1,I1", "Unit,V,A"], [row.partition(",")[2] for row in PLAIN]),
        (["Time [s],u1 [V],i1 [A]", "Waveform Data,"], PLAIN),
        (["Sampling interval,250us", "Date&Time,CH1,CH2", "Time,V,A"], STAMPED),
        (['"TIMESTAMP","U_L1","I_L1"', '"TS","V","A"', '"","Smp","Smp"'], PLAIN),
        (["Time:,U1:,I1:"], PLAIN),
        (['"time [s]","u1 [V]","i1 [A]"'], ['"' + row.replace(";", '","') + '"' for row in GERMAN]),
        (
            ["Время (с);Напряжение (кВ);Ток (мА)"],
            [f"{t:.5f};{u / 1000:.7f};{i * 1000:.1f}" for t, u, i in zip(T, VOLTS, AMPERES, strict=True)],
        ),
        (["Rate:,4000", "U1:,I1:"], [row.partition(",")[2] for row in PLAIN]),
    ],
)
def test_rows_of_units_stand_above_their_columns(tmp_path, head, rows):
    waveform = load_waveform(written(tmp_path, head, rows))
    rms = np.sqrt(((waveform.codes * np.array(waveform.form.scale))[:960] ** 2).mean(axis=0))
    assert rms == pytest.approx([230, 5], rel=1e-3) and waveform.form.rate == pytest.approx(4_000, rel=1e-4)


def test_times_without_a_name_and_names_with_their_unit_are_understood(tmp_path):
    path = written(tmp_path, ["XInc:,2.5E-04", "Frame:,DSO-S 254A", "Data:,"], PLAIN)
    assert load_waveform(path, ChannelMap({"u1": "1", "i1": "2"})).form.rate == pytest.approx(4_000)
    path = written(tmp_path, ["time [s],CH1 [V],CH2 [A]"], PLAIN)
    assert load_waveform(path, ChannelMap({"u1": "CH1 [V]", "i1": "CH2"})).form.phases == 1


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        (["Vertical Scale,100,5", "Sampling Period,250us", "CH1 [V],CH2 [A]"],
         [f"{round(u / 4)},{round(5 * i)}" for u, i in zip(VOLTS, AMPERES, strict=True)], "codes of a converter"),
        (["t [s];u1 [V];i1 [A]"], [f"0,0;1.{k % 900 + 100}.000,25;1,5" for k in range(50)], "separators of thousands"),
        (["time,u1 [V],i1 [A]"], [f"{4 * k},{row.partition(',')[2]}" for k, row in enumerate(PLAIN)], "times right"),
        (["t [s];u1 [V];i1 [A]"], [f"0,0;1\u202f{k % 900 + 100},25;1,5" for k in range(50)], "separators of thousands"),
        (["t [s];u1 [V];i1 [A]"], [f"0,0;1.{k % 900 + 100};1,5" for k in range(50)], r"'1\.100' is not a number"),
        (["time [s],V1 RMS (V),A1 RMS (A)"], PLAIN, "RMS or other computed values"),
        (["time [s],u1 [%],i1 [A]"], PLAIN, "'u1' is in %"),
        (["time [s],u1 [V],time [ms],i1 [A]"],
         [f"{t:.5f},{u:.4f},{1000 * t + 5:.2f},{i:.4f}" for t, u, i in zip(T, VOLTS, AMPERES, strict=True)],
         "columns 1 and 3 are up to 0.005 s apart"),
    ],
)  # fmt: skip
def test_what_a_table_cannot_mean_is_refused_with_the_reason(tmp_path, head, rows, said):
    with pytest.raises(InputError, match=said):
        load_waveform(written(tmp_path, head, rows))


def test_an_axis_of_times_within_a_step_shifts_its_channels_and_other_times_do_not(tmp_path):
    columns = VOLTS, AMPERES
    aligned = load_waveform(written(tmp_path, ["time [s],u1 [V],i1 [A]"], PLAIN))
    later = np.interp(T + 1e-4, T, AMPERES)
    rows = [f"{t:.5f},{u:.4f},{1000 * t + 0.1:.2f},{i:.4f}" for t, u, i in zip(T, VOLTS, later, strict=True)]
    shifted = load_waveform(written(tmp_path, ["time [s],u1 [V],time [ms],i1 [A]"], rows))
    assert np.abs(shifted.codes[:900] - aligned.codes[1:901]).max() < 0.02 * 325
    results = ["20.1" if k < 3 else "" for k in range(len(T))], [f"{20 + k % 7}" for k in range(len(T))]
    for beside in results:
        rows = [f"{t:.5f},{u:.4f},{x},{i:.4f}" for t, u, x, i in zip(T, *columns[:1], beside, AMPERES, strict=True)]
        loaded = load_waveform(written(tmp_path, ["time [s],u1 [V],period [ms],i1 [A]"], rows))
        assert np.array_equal(loaded.codes, aligned.codes)


def test_stamps_that_leave_rows_out_are_not_overruled_by_a_rate_above_them(tmp_path):
    stamps = [f"2024-03-01T10:00:{t + (0.5 if t > 0.1 else 0):09.6f}" for t in T]
    rows = [f"{stamp},{row.partition(',')[2]}" for stamp, row in zip(stamps, PLAIN, strict=True)]
    loaded = load_waveform(written(tmp_path, ["Sample rate,4000", "time,u1 [V],i1 [A]"], rows))
    assert sum(lost for _, lost in loaded.breaks) * (T[1] - T[0]) == pytest.approx(0.5)


@pytest.mark.parametrize("tail", ["0.249750,12", "0.249750,", "\0" * 300])
def test_a_row_that_nobody_ended_is_left_out(tmp_path, tail):
    path = written(tmp_path, ["time,u1 [V],i1 [A]"], PLAIN[:-1])
    path.write_text(path.read_text().rstrip("\n") + "\n" + tail)
    loaded = load_waveform(path)
    assert len(loaded.codes) == len(PLAIN) - 1 and "its last row is cut off: left out" in loaded.notes


def test_clocks_of_microcontrollers_are_times(tmp_path):
    rows = [f"{round(t * 1e6)},{row.partition(',')[2]}" for t, row in zip(T, PLAIN, strict=True)]
    assert load_waveform(written(tmp_path, ["micros,u1 [V],i1 [A]"], rows)).form.rate == pytest.approx(4_000)


def test_a_last_row_of_utf_16_that_is_ended_is_not_left_out(tmp_path):
    path = written(tmp_path, ["time,u1 [V],i1 [A]"], PLAIN)
    text = path.read_text().rstrip("\n") + "\n0.25,x,1"
    path.write_bytes(text.encode("utf-16"))
    assert len(load_waveform(path).codes) == len(PLAIN)
    path.write_bytes(f"{text}\n".encode("utf-16"))
    with pytest.raises(InputError, match="'x' is not a number"):
        load_waveform(path)


def test_a_clock_that_was_set_from_1970_to_today_is_no_pause(tmp_path):
    rows = [f"{t + (1.7e9 if t > 0.1 else 0):.6f},{row.partition(',')[2]}" for t, row in zip(T, PLAIN, strict=True)]
    with pytest.raises(InputError, match=r"1\.7e\+09 s after the row before"):
        load_waveform(written(tmp_path, ["time [s],u1 [V],i1 [A]"], rows))
