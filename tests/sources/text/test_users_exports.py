"""Headers as users of instruments show them in public, made again here: read, or refused with what to do."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.errors import InputError
from acqd.sources import ChannelMap, load_waveform

RATE = 10_000.0
T = np.arange(800) / RATE
WAVE = [np.sqrt(2) * np.cos(2 * np.pi * (50 * T - k / 3)) for k in range(3)]
U, I = 230 * WAVE[0], 5 * np.roll(WAVE[0], 17)  # noqa: E741 - the current


def table(*columns, row="{},{},{}"):
    return "".join(row.format(*(f"{x:.7g}" for x in values)) + "\n" for values in zip(*columns, strict=True))


SECONDS = table(T, U, I)
TDS = ["Record Length,8.0e+02", "Sample Interval,1.0e-04", "Source,CH1", "Vertical Units,V", "Yzero,0.0",
       "Probe Atten,1.0", "Model Number,TDS2024B", "Firmware Version,FV:v22.11"]  # fmt: skip
READ = {
    "rtb.csv": "in s,C1 in V,C2 in A\n" + SECONDS,
    "first_row_empty.csv": "x-axis,1,2\nsecond,Volt,Ampere\n-0.1,,\n" + SECONDS,
    "infiniium.csv": (
        "Revision:,0\nPoints:,800\nXDispOrg:,-4E-02\nXInc:,+1.0E-04\nXOrg:,-4E-02\nXUnits:,Second\nYUnits:,Volt,Ampere\n"
        "Date:,14 NOV 2023\nTime:,12:00:00\nData:\n" + table(U, I, row="{},{}")
    ),
    "sigrok.csv": "; Channels (2/2): CH1, CH2\n; Samplerate: 10 kHz\nV,A\n" + table(U, I, row="{},{}"),
    "digital.csv": (
        "Model,MDO3014\nSample Interval,0.0001,0.0001,,Sample Interval,0.0001,\n"
        "Vertical Units,V,A,,Vertical Units,V,\nTIME,CH1,CH2,,TIME,D0,\n"
        + table(T, U, I, T, 0 * T, row="{},{},{},,{},{},")
    ),
    "hioki.csv": (
        '"File name","M1.MEM"\n"Trigger Time","\'23-11-14 12:00:00"\n"CH","U1-1","U1-2"\n'
        '"Time[s]","U1-1[V]","U1-2[A]"\n' + SECONDS
    ),
    "fluke.csv": "Title,Scope Record\nReading #,800\nTime (s),Input A (V),Input B (A)\n" + SECONDS,
    "perception.csv": '"Time","Recorder A.Ch A1","Recorder A.Ch A2"\n"s","V","A"\n' + SECONDS,
    "diadem.csv": "/Group/Time,/Group/U1,/Group/I1\ns,V,A\n" + SECONDS,
    "waveforms.csv": (
        "#Digilent WaveForms Oscilloscope Acquisition\n#Date Time: 2023-11-14 12:00:00.000\n#Sample rate: 10000Hz\n"
        "#Samples: 800\n\nTime (s),Channel 1 (V),Channel 2 (A)\n" + SECONDS
    ),
    "slash.csv": "Time / s,Vm1:Measured voltage / V,Am1:Measured current / A\n" + SECONDS,
    "tails.csv": "t_s,U_V,I_A\n" + SECONDS,
    "gantner.csv": "Timestamp;U1;I1\nUTC;V;A\n"
    + "".join(f"2024-03-09 08:07:06.{round(t * 1e6):06d};{u:.7g};{i:.7g}\n" for t, u, i in zip(T, U, I, strict=True)),
    "mr8880.csv": '"Trigger time","\'24-03-09 08:07:06.000"\n"Time","CH1[V]","CH2[A]"\n"s","",""\n' + SECONDS,
    "sds.csv": (
        "Record Length,Analog:800\nSample Interval,Analog:1.0E-04\nVertical Units,CH1:V CH2:A\nSource,CH1,CH2\n"
        "Second,Value,Value\n" + SECONDS
    ),
    "sds1000x_u.csv": (
        "Record Length,Analog:800,\nSample Interval,Analog:1.000000E-04,\nVertical Units,CH1:V, CH2:A,,\n"
        "Vertical Scale,1.00, 1.00,,\nHorizontal Units,us,\nSource,CH1,CH2\nSecond,Value,Value\n" + SECONDS
    ),
    "hilogger.csv": (
        '"File name","WAVE0001.CSV","V 1.00"\n"Trigger Time","\'23-11-14 12:00:00"\n'
        '"Ch","Mode","Range","Comment","Scaling","Ratio","Offset"\n"CH-1","Voltage","600V","mains","Off","-","-"\n'
        '"CH-2","Current","10A","load","Off","-","-"\n"ALM","Alarm","",""\n'
        '"Time","CH-1[V]","CH-2[A]","ALM-CH1","Event",\n' + table(T, U, I, row="{},{},{},0,0,")
    ),
    "owon.csv": (
        "Channel :,CH1,CH2\nFrequency :,F=50Hz,F=50Hz\nProbe attenuation :,1X,1X\nTime interval :,100.00uS\n\n"
        "index,CH1_Voltage(V),CH2_Current(A)\n"
        + "".join(f"{k},{u:.7g},{i:.7g}\n" for k, (u, i) in enumerate(zip(U, I, strict=True)))
    ),
    "ca8336.csv": "CA8336\nTime (ms);V1 (V);A1 (A)\n" + table(1e3 * T, U, I, row="{};{};{}"),
    "fluke_fr.csv": "Temps;Entrée A;Entrée B\ns;V;A\n" + SECONDS.replace(",", ";").replace(".", ","),
    "messrate.csv": "Messrate [kHz];10\nSpannung [V];Strom [A]\n" + table(U, I, row="{};{}").replace(".", ","),
    "labview_stamps.csv": "time\tU [V]\tI [A]\n"
    + "".join(f"09/13/2024 08:07:06.{round(t * 1e6):06d}\t{u:.7g}\t{i:.7g}\n" for t, u, i in zip(T, U, I, strict=True)),
    "results_below.csv": "t,u,i\n" + SECONDS + "\nMean,0.0,0.0\nEnd of file\n",
    "ac.csv": "t [s],U [V AC],I [A AC]\n" + SECONDS,
    "owon_colons.csv": "Sample Interval,:100.000us\nIndex,CH1 Voltage(V),CH2 Current(A)\n"
    + "".join(f"{k},{u:.7g},{i:.7g}\n" for k, (u, i) in enumerate(zip(U, I, strict=True))),
    "spice.txt": "time\tV(in)\tI(Rload)\n" + table(T, U, I, row="{}\t{}\t{}"),
    "spice_nodes.txt": "time\tV(l1,n)\tI(L1)\n" + table(T, U, I, row="{}\t{}\t{}"),
    "pscad.txt": "Domain Va Ia\n" + table(T, U, I, row="{}  {}  {}"),
    "epoch.csv": "timestamp,u1,i1\n"
    + "".join(
        f"{1_699_963_200_000_000 + 100 * k},{u:.7g},{i:.7g}\n" for k, (u, i) in enumerate(zip(U, I, strict=True))
    ),
    "twincat.csv": (
        "Name\tYT Scope Project\nFile\tmains.tcscopex\nStarttime of export\t133444368000000000\tTuesday\n\n"
        "Name\tU_L1\tName\tI_L1\nSymbolName\tMAIN.u\tSymbolName\tMAIN.i\nSampleTime[ms]\t0.1\tSampleTime[ms]\t0.1\n"
        "Unit\tV\tUnit\tA\n\n" + table(1e3 * T, U, 1e3 * T, I, row="{}\t{}\t{}\t{}")
    ),
    "iec61850.csv": "t,TVTR1.VolSv.instMag.i,TCTR1.AmpSv.instMag.i\n" + SECONDS,
}


@pytest.mark.parametrize("name", READ)
def test_read(tmp_path, name):
    (tmp_path / name).write_text(READ[name])
    waveform = load_waveform(tmp_path / name, ChannelMap())
    assert waveform.form.rate == pytest.approx(RATE) and waveform.form.phases == 1
    np.testing.assert_allclose(waveform.codes * waveform.form.scale, np.stack((U, I), axis=1), rtol=1e-5, atol=1e-4)
    said = " ".join(waveform.notes)
    assert ("1 left out" in said) == (name == "first_row_empty.csv")
    assert ("lines below its table: 2 left out ('Mean,0.0,0.0')" in said) == (name == "results_below.csv")
    dated = {
        "waveforms.csv": 1_699_963_200,
        "epoch.csv": 1_699_963_200,
        "gantner.csv": 1_709_971_626,
        "mr8880.csv": 1_709_971_626,
    }
    if name in dated:
        assert waveform.start_utc_ns == dated[name] * 10**9


@pytest.mark.parametrize("lost", [1, 400])
def test_rows_that_are_missing_are_a_gap_also_where_times_have_no_more_digits_than_they_need(tmp_path, lost):
    kept = np.r_[0:300, 300 + lost : 800]
    (tmp_path / "a.csv").write_text("t [s],u,i\n" + table(T[kept], U[kept], I[kept], row="{},{},{}"))
    if lost == 1:  # rounding of a slower clock looks alike
        with pytest.raises(InputError, match="too coarsely"):
            load_waveform(tmp_path / "a.csv", ChannelMap())
        return
    assert load_waveform(tmp_path / "a.csv", ChannelMap()).breaks == ((300, lost),)


@pytest.mark.parametrize(
    "names",
    ["U_U,U_V,U_W,I_U,I_V,I_W", "Vabc:1,Vabc:2,Vabc:3,Iabc:1,Iabc:2,Iabc:3", "V_abc(1),Vabc[2],vabc.3,ia,ib,ic"],
)
def test_three_phases_are_in_their_order(tmp_path, names):
    units = [f"{name} [{'VA'[k > 2]}]" for k, name in enumerate(names.split(","))]
    columns = [*(230 * one for one in WAVE), *(5 * one for one in WAVE)]
    rows = table(T, *columns, row=",".join(["{}"] * 7))
    (tmp_path / "a.csv").write_text("time [s]," + ",".join(units) + "\n" + rows)
    codes = load_waveform(tmp_path / "a.csv", ChannelMap()).codes
    np.testing.assert_allclose(codes, np.stack(columns, axis=1)[:, [0, 3, 1, 4, 2, 5]], rtol=1e-5, atol=1e-4)


def tds(values, unit, channel):
    head = [*TDS[:2], f"Source,CH{channel}", f"Vertical Units,{unit}", *TDS[4:]] + [","] * (len(T) - len(TDS))
    return "".join(f"{line},,{t:.6f},{x:.7g},\n" for line, t, x in zip(head, T, values, strict=True))


@pytest.mark.parametrize(("opened", "unit", "options"), [
    ("F0000CH1.CSV", "A", {}), ("F0000CH2.CSV", "A", {}),
    ("F0000CH1.CSV", "V", {"columns": {"u1": "CH1", "i1": "CH2"}, "u_scale": 1.0, "i_scale": 1.0}),
])  # fmt: skip
def test_files_of_one_channel_are_read_together(tmp_path, opened, unit, options):
    (tmp_path / "F0000CH1.CSV").write_text(tds(U, "V", 1))
    (tmp_path / "F0000CH2.CSV").write_text(tds(I, unit, 2))
    (tmp_path / "F0000CH3.CSV").write_text("".join(tds(I, "A", 3).splitlines(keepends=True)[:700]))
    (tmp_path / "F0000CH4.CSV").write_text("nothing\n")
    waveform = load_waveform(tmp_path / opened, ChannelMap(**options))
    np.testing.assert_allclose(waveform.codes, np.stack((U, I), axis=1), rtol=1e-5, atol=1e-4)
    said = " ".join(waveform.notes)
    assert "left out: " in said and "F0000CH4.CSV" in said
    assert "read together with it: F0000CH" in said and "F0000CH3.CSV has another length" in said


def test_a_file_that_was_taken_later_is_moved_to_the_times_of_the_first(tmp_path):
    for k, (x, later) in enumerate(((U, 0.0), (I, 3e-5)), start=1):
        (tmp_path / f"CH{k}.csv").write_text(f"in s,C{k} in {'VA'[k > 1]}\n" + table(T + later, x, row="{},{}"))
    codes = load_waveform(tmp_path / "CH1.csv", ChannelMap()).codes
    expected = 5 * np.sqrt(2) * np.cos(2 * np.pi * 50 * (T - 17 / RATE - 3e-5))[1:]  # both are known from there on
    np.testing.assert_allclose(codes[20:700, 1], expected[20:700], atol=2e-3)


REFUSED = {
    "tds.csv": ("".join(f"{head},,{t:.6f},{u:.4f},\n" for head, t, u in zip(TDS, T, U, strict=False)),
                "put the file of the current beside"),
    "envelope.csv": ("in s,C1 in V,C2 in A\n" + table(np.repeat(T[:400], 2), U, I), "envelope"),
    "thousands.csv": ("time [s],u1 [V],i1 [mA]\n" + table(T, U, np.full(800, 6), row='{},{},"1,03{}.0"'), "thousand"),
    "over_range.csv": ("time [s],u1 [V],i1 [A]\n" + SECONDS + "0.08,∞,1\n", r"row 802, column 2: '∞' is beyond"),
    "commas.csv": ("time,u1,i1\n" + SECONDS.replace(".", ","), "names 3 columns, and the rows below have"),
    "second_table.csv": ("t,u,i\n" + SECONDS + "\nt,u,i\n" + SECONDS, r"row 803, column 1: 't' is not a number"),
    "probe.csv": ("t [s],u [V],i [V] 10mV/A\n" + SECONDS, "its unit '10mV/A' is unknown"),
    "shunt.csv": ("t [s],u [V],i [V @ 0.1 Ohm]\n" + SECONDS, "its unit 'V @ 0.1 Ohm' is unknown"),
    "two_nodes.txt": ("time\tV(in)\tV(out)\tI(R1)\n" + table(T, U, U / 2, I, row="{}\t{}\t{}\t{}"),
                      "no voltage and current pair"),
    "decibel.txt": ("time,V(dBV),I(dBA)\n" + SECONDS, "its unit 'dBA' is unknown"),
    "probe_of_i.txt": ("time,V(in),I (mV/A)\n" + SECONDS, "its unit 'mV/A' is unknown"),
    "two_letters.csv": ("a12,b\n" + table(T, U, row="{},{}"), "no voltage and current pair"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refused(tmp_path, name):
    text, said = REFUSED[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=said):
        load_waveform(tmp_path / name, ChannelMap())
