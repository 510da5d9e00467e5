"""Text exports of instruments, in two locales each."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.metering import Meter, SampleBlock
from acqd.sources import ChannelMap, load_waveform
from acqd.sources.load import load_recording
from acqd.sources.text.layout import find_layout, known_layouts
from tests.sources.text.exports import ENGLISH, GERMAN, RATE, TABBED, WRITERS

LOCALES = {"english": ENGLISH, "german": GERMAN, "tabbed": TABBED}
T = np.arange(2_000) / RATE
U = 230 * np.sqrt(2) * np.cos(2 * np.pi * 50 * T)
I = 5 * np.sqrt(2) * np.cos(2 * np.pi * 50 * T - 0.5)  # noqa: E741


def assert_metered(waveform):
    assert waveform.form.rate == pytest.approx(RATE, rel=1e-5)
    batch = Meter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0))
    assert batch.Vrms[0, -1] == pytest.approx(230, rel=1e-4)
    assert batch.Irms[0, -1] == pytest.approx(5, rel=1e-4)
    assert batch.P[0, -1] == pytest.approx(230 * 5 * np.cos(0.5), rel=1e-4)


@pytest.mark.parametrize("locale", LOCALES)
@pytest.mark.parametrize("maker", WRITERS)
def test_an_export_is_metered_as_it_is(tmp_path, maker, locale):
    write, layout = WRITERS[maker]
    path = tmp_path / ("a.lvm" if maker == "labview" else "a.csv")
    path.write_text(write(LOCALES[locale], T, U, I) + "\n")
    assert load_recording(path, ChannelMap()).format == find_layout(layout).title
    assert_metered(load_waveform(path))


@pytest.mark.parametrize("maker", ["hioki", "dewesoft", "labview", "yokogawa", "stamped", "time_of_day"])
def test_an_export_that_names_its_date_is_dated(tmp_path, maker):
    path = tmp_path / "a.csv"
    path.write_text(WRITERS[maker][0](ENGLISH, T, U, I))
    begun = {"hioki": 0.25, "dewesoft": 0.25, "labview": 0.25, "yokogawa": 0.2}.get(maker, 0.0)
    assert load_waveform(path).start_utc_ns == 1_687_342_500_000_000_000 + round(begun * 1e9)


def test_windows_line_ends_a_byte_order_mark_and_latin_1_change_nothing(tmp_path):
    text = WRITERS["picoscope"][0](GERMAN, T, U, I).replace("(ms)", "(µs)")
    lines = text.split("\n")
    rows = [";".join([f"{k * 100}", *line.split(";")[1:]]) for k, line in enumerate(lines[3:])]
    for encoding in ("utf-8-sig", "latin-1"):
        path = tmp_path / f"{encoding}.csv"
        path.write_bytes("\r\n".join([*lines[:3], *rows, ""]).encode(encoding))
        assert_metered(load_waveform(path))


def test_two_voltages_of_an_oscilloscope_need_scales_and_the_error_says_so(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(WRITERS["keysight"][0](ENGLISH, T, U / 100, I / 10).replace("Ampere", "Volt"))
    with pytest.raises(InputError, match=r"--map u1=1,i1=2 --u-scale 1 --i-scale 1"):
        load_waveform(path)
    assert_metered(load_waveform(path, ChannelMap({"u1": "1", "i1": "2"}, u_scale=100.0, i_scale=10.0)))


def test_one_channel_a_file_is_refused_with_what_to_do(tmp_path):
    rows = ["Record Length,2.000000e+03,,-0.100,1.5", "Sample Interval,1.0e-04,,-0.0999,2.5", "Source,CH1,,-0.0998,3.5"]
    rows += [
        "Vertical Units,V,,-0.0997,1",
        "Yzero,0,,-0.0996,2",
        *[f",,,{-0.0995 + k * 1e-4:.4f},{k}" for k in range(50)],
    ]
    (tmp_path / "F0000CH1.CSV").write_text("\n".join(rows))
    with pytest.raises(InputError, match=r"power needs"):
        load_waveform(tmp_path / "F0000CH1.CSV")


def test_a_layout_of_a_user_s_own(tmp_path):
    path = tmp_path / "a.csv"
    body = "\n".join(f"x;{u:.5f};{i:.5f}" for u, i in zip(U, I, strict=True))
    path.write_text("Takt: 0.1 ms\nSpannung;Strom;unused\nalpha;beta;gamma\n1;2;3\n4;5;6\n7;8;9\n" + body)
    layout = tmp_path / "mine.toml"
    layout.write_text('title = "mine"\nincrement = ["Takt"]\nfirst_row = 7\nnames_row = 2\ncolumns = [1, 2]\n')
    with pytest.raises(InputError):
        load_waveform(path)
    given = ChannelMap({"u1": "0", "i1": "1"}, rate=RATE, layout=str(layout))
    assert_metered(load_waveform(path, given))
    layout.write_text("increments = 3\n")
    fresh = tmp_path / "other.toml"
    fresh.write_text("increments = 3\n")
    with pytest.raises(InputError, match=r"unknown key increments; a layout has .*increment"):
        find_layout(str(fresh))


def test_every_layout_can_be_read_and_names_its_source():
    for name in known_layouts():
        layout = find_layout(name)
        assert layout.title and layout.source, name


@pytest.mark.parametrize(
    ("header", "u", "i", "t"),
    [("time,u1 [V],i1 [mA]", 1, 1e3, 1), ("time [ms],u1 (mV),i1", 1e3, 1, 1e3), ("Time(us),u1 [kV],i1 [kA]", 1e-3, 1e-3, 1e6),  # noqa: E501
     ("Time (s),u1/V,i1/A", 1, 1, 1), ("t_ms,u1_V,i1_mA", 1, 1e3, 1e3), ('"t / s",U in kV,I in mA', 1e-3, 1e3, 1)],
)  # fmt: skip
def test_units_of_a_header_count(tmp_path, header, u, i, t):
    path = tmp_path / "a.csv"
    rows = [f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in zip(T * t, U * u, I * i, strict=True)]
    path.write_text("\n".join([header, *rows]))
    assert_metered(load_waveform(path))


@pytest.mark.parametrize(
    "header",
    [
        "time,u1 [bar],i1",
        "time,u1 [Gauss],i1 [A]",
        "time,u1 [MV],i1",
        "time,u1 [A],i1 [A]",
        "time,u1 x10,i1",
        "time,adc_u1,i1",
        "time,u1_raw,i1",
    ],
)
def test_a_unit_that_is_none_is_refused_until_the_user_says_the_scale(tmp_path, header):
    path = tmp_path / "a.csv"
    rows = [f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in zip(T, U, I, strict=True)]
    path.write_text("\n".join([header, *rows]))
    with pytest.raises(InputError, match=r"--map|--u-scale"):
        load_waveform(path)
    assert_metered(load_waveform(path, ChannelMap({"u1": "1", "i1": "2"}, u_scale=1.0)))


def test_a_column_that_counts_from_the_start_of_a_computer_is_no_date(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{172_800_000 + a * 1e3:.1f},{b:.6f},{c:.6f}" for a, b, c in zip(T, U, I, strict=True)]
    path.write_text("\n".join(["time,u1,i1", *rows]))
    waveform = load_waveform(path, ChannelMap(rate=RATE))
    assert waveform.start_utc_ns is None
    notes = " ".join(waveform.notes)
    assert "no date between 2000 and today" in notes and "--rate 10000 overrules the file" in notes
    path.write_text("\n".join(["time [ms],u1,i1", *rows]))
    assert_metered(load_waveform(path))


def test_coarse_stamps_need_a_rate(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"10:15:{s:06.3f},{v:.4f},{a:.4f}" for s, v, a in zip(T, U, I, strict=True)]
    path.write_text("\n".join(["time,u1,i1", *rows]))
    with pytest.raises(InputError, match="too coarsely"):
        load_waveform(path)
    assert_metered(load_waveform(path, ChannelMap(rate=RATE)))


def test_a_row_of_units_that_is_one_short_is_no_traceback(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{a:.5f},{b:.4f},{c:.4f},{k}" for k, (a, b, c) in enumerate(zip(T, U, I, strict=True))]
    path.write_text("\n".join(["time,u1,i1,n", "s,kV,mA", *rows]))
    assert load_waveform(path).form.scale == (1e3, 1e-3)


@pytest.mark.parametrize("increment", ["0..0", "-1", "1e-", "fast", "0"])
def test_an_increment_that_is_none_is_named(tmp_path, increment):
    path = tmp_path / "a.csv"
    path.write_text(WRITERS["yokogawa"][0](ENGLISH, T, U, I).replace("1e-04", increment))
    with pytest.raises(InputError, match="its increment is"):
        load_waveform(path)


def written(tmp_path, head, *columns):
    path = tmp_path / "a.csv"
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@pytest.mark.parametrize("line", ["Sample Rate [kS/s],10", "Sampling interval (us),100", "dt (ms),0.1"])
def test_a_line_above_the_table_may_have_its_unit_in_the_name(tmp_path, line):
    assert_metered(load_waveform(written(tmp_path, f"{line}\nVoltage [V],Current [A]", U, I)))


def test_what_the_header_says_is_held_against_the_table(tmp_path):
    path = written(tmp_path, "Sample rate,20000\nSamples,3000\ntime [s],u1,i1", T, U, I)
    notes = " ".join(load_waveform(path).notes)
    assert "its header says 20000 samples/s, its time column 10000, which holds" in notes
    assert "announces 3000 rows, the table has 2000" in notes
    path = written(tmp_path, "Sample rate,10000\ntime,u1,i1", T * 1e3, U, I)
    with pytest.raises(InputError, match=r"10000 samples/s, its time column 10; name the unit"):
        load_waveform(path)
    assert_metered(load_waveform(path, ChannelMap(rate=RATE)))


@pytest.mark.parametrize("head", ["s,kV,mA\ntime,u1,i1", "t,U1kV,I1mA", "t_s,UL1kV,IL1mA"])
def test_units_above_the_names_or_glued_to_them_count(tmp_path, head):
    assert_metered(load_waveform(written(tmp_path, head, T, U / 1e3, I * 1e3)))


@pytest.mark.parametrize(
    ("head", "timed"),
    [("CH1V,CH2A,t0 = -0.1, tInc = 1e-04,", False), ("in s,C1 in V,C2 in A", True),
     ("Record Length,Analog:2000\nSample Interval,Analog:1.0E-04\nVertical Units,Analog:V,A\nSource,CH1,CH2\nSecond,Volt,Ampere", True)],  # noqa: E501
)  # fmt: skip
def test_what_makers_write_in_a_header_of_their_own_is_read(tmp_path, head, timed):
    assert_metered(load_waveform(written(tmp_path, head, *((T, U, I) if timed else (U, I)))))


@pytest.mark.parametrize("name", ["u1 (x100)", "u1 (100x)", "u1 [10^3 V]", "u1 [10^3V]"])
def test_a_scale_in_brackets_is_refused(tmp_path, name):
    with pytest.raises(InputError, match=r"--u-scale"):
        load_waveform(written(tmp_path, f"time,{name},i1", T, U, I))


@pytest.mark.parametrize(("line", "said"), [("Multiplier,1000,0.001", True), ("Probe Attenuation,1,1", False),
                                             ("Vertical Scale,100,5", False), ("CT ratio,40", True)])  # fmt: skip
def test_a_factor_above_the_table_is_named(tmp_path, line, said):
    notes = " ".join(load_waveform(written(tmp_path, f"{line}\ntime,u1,i1", T, U, I)).notes)
    assert ("a factor that is not applied" in notes) == said


def test_files_of_one_channel_named_by_its_unit_are_metered_together_and_others_are_named(tmp_path):
    for number, unit, values in ((1, "V", U), (2, "A", I)):
        written(tmp_path, f"Time,{unit}", T, values).rename(tmp_path / f"s_CH{number}.csv")
    assert_metered(load_waveform(tmp_path / "s_CH1.csv"))
    written(tmp_path, "Time,A", T[:-1], I[:-1]).rename(tmp_path / "s_CH2.csv")
    with pytest.raises(InputError, match=r"s_CH2.csv has another length or rate"):
        load_waveform(tmp_path / "s_CH1.csv")
