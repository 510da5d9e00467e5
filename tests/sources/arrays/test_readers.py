"""MATLAB, HDF5, Parquet, Arrow and TDMS files of one signal are metered alike."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.metering import Meter, SampleBlock
from acqd.sources import ChannelMap, load_waveform
from acqd.sources.arrays.factors import scales
from tests.sources.arrays import writers
from tests.sources.arrays.writers import RATE, START_NS, WRITERS, I, T, U

pytestmark = pytest.mark.xdist_group("files")  # one worker imports the libraries


def written(folder, write):
    write(folder)
    return next(folder.iterdir())


def assert_metered(waveform):
    assert waveform.form.rate == pytest.approx(RATE, rel=1e-6)
    batch = Meter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0))
    found = [float(column[0, -1]) for column in (batch.Vrms, batch.Irms, batch.P)]
    assert found == pytest.approx([230, 5, 230 * 5 * np.cos(0.5)], rel=1e-4)


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_is_metered_as_it_is(tmp_path, name):
    waveform = load_waveform(written(tmp_path, WRITERS[name]))
    assert_metered(waveform)
    assert waveform.start_utc_ns == (START_NS if name in ("parquet", "tdms") else None)


def test_a_rate_in_kilohertz_and_a_step_in_microseconds_are_understood(tmp_path):
    assert_metered(load_waveform(mat(tmp_path, u1=U, i1=I, fs_kHz=RATE / 1e3)))
    assert_metered(load_waveform(mat(tmp_path, u1=U, i1=I, dt_us=1e6 / RATE, n=np.arange(len(T)))))
    assert_metered(load_waveform(mat(tmp_path, u1=U, i1=I, micros=1e6 * T)))


@pytest.mark.parametrize(
    "named",
    [
        {"s": {"t": "T", "Va": 0, "Vb": 1, "Vc": 2, "Ia": 3, "Ib": 4, "Ic": 5}},
        {"t": "T", "Vabc": slice(0, 3), "Iabc": slice(3, 6)},
        {"tout": "T", "logs": {"Vabc": slice(0, 3), "Iabc": slice(3, 6)}},
    ],
)
def test_phases_of_structs_and_matrices_are_in_their_order(tmp_path, named):
    columns = np.stack([*(k * U for k in (1.0, 0.9, 0.8)), *(k * I for k in (1.0, 0.7, 0.5))], axis=1)

    def made(one):
        if isinstance(one, dict):
            return {name: made(value) for name, value in one.items()}
        return T if one == "T" else columns[:, one]

    waveform = load_waveform(mat(tmp_path, **made(named)))
    np.testing.assert_array_equal(waveform.codes, columns[:, [0, 3, 1, 4, 2, 5]])


def test_inputs_of_an_oscilloscope_need_a_map(tmp_path):
    path = written(tmp_path, writers.mat_picoscope)
    with pytest.raises(InputError, match=r"--map u1="):
        load_waveform(path)
    assert_metered(load_waveform(path, ChannelMap({"u1": "A", "i1": "B"})))


def test_a_slower_channel_is_left_out_with_a_word(tmp_path):
    notes = load_waveform(written(tmp_path, writers.tdms)).notes
    assert any("Temperature" in note and "left out" in note for note in notes)


def test_a_file_whose_end_is_missing_is_read_so_far_with_a_word(tmp_path, capfd):
    path = written(tmp_path, writers.tdms)
    path.write_bytes(path.read_bytes()[:-4_000])  # of 8000 of the current
    waveform = load_waveform(path)
    assert len(waveform.codes) == 1_500
    assert any("less data than expected" in note for note in waveform.notes)
    assert not capfd.readouterr().err


def mat(tmp_path, **variables):
    writers.matlab(tmp_path / "a.mat", variables)
    return tmp_path / "a.mat"


@pytest.mark.parametrize(
    ("variables", "complaint"),
    [
        ({"u1": U, "i1": I}, "--rate"),
        ({"u1": U, "i1": I, "fs": 1e4, "dt": 2e-4}, "several sampling rates"),
        ({"fs": 1e4, "n": 3}, "no arrays of samples"),
        ({"time": np.where(np.arange(len(T)) % 20 > 9, T + 0.01, T), "u1": U, "i1": I}, "equidistant"),
        ({"time": T, "u1_pu": U / 325, "i1": I}, "i1 but no u1"),
        ({"t": 738_000 + T / 86_400, "u1": U, "i1": I}, "are its times in ms, us or days"),
        ({"time": T, "u1": U > 0, "i1": I}, "i1 but no u1"),
        ({"time": T, "u1": np.where(T == 0.1, np.nan, U), "i1": I}, "sample 1000, u1: nan"),
    ],
)
def test_what_does_not_say_enough_is_refused(tmp_path, variables, complaint):
    with pytest.raises(InputError, match=complaint):
        load_waveform(mat(tmp_path, **variables))


def test_times_that_pause_are_a_gap(tmp_path):
    waveform = load_waveform(mat(tmp_path, time=np.where(T > 0.1, T + 0.01, T), u1=U, i1=I))
    assert waveform.breaks == ((int((T <= 0.1).sum()), round(0.01 / (T[1] - T[0]))),)


def test_a_scale_beside_the_samples_of_a_struct_is_named(tmp_path):
    waveform = load_waveform(mat(tmp_path, time=T, u1={"data": U, "scale": 0.05, "unit": "V"}, i1=I))
    assert any("u1 has a field scale, which is not applied" in note for note in waveform.notes)


@pytest.mark.parametrize("factor", [0.05, [0.0, 0.05]])
def test_codes_of_a_struct_with_a_scale_need_its_value(tmp_path, factor):
    codes, h5py = np.rint(20 * U).astype("i2"), pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, value in (("data", codes), ("unit", "V"), ("scale", factor)):
            file[f"u1/{name}"] = value
        file["time"], file["i1"] = T, I
    for path in (tmp_path / "a.h5", mat(tmp_path, time=T, u1={"data": codes, "scale": factor, "unit": "V"}, i1=I)):
        with pytest.raises(InputError, match=r"u1/data.*whole numbers"):
            load_waveform(path)


def test_whole_numbers_without_a_unit_may_be_codes_also_as_double_numbers(tmp_path):
    codes = np.rint(20 * U)
    with pytest.raises(InputError, match=r"whole numbers.*--u-scale"):
        load_waveform(mat(tmp_path, time=T, u1=codes, i1=np.rint(100 * I)))
    assert not load_waveform(mat(tmp_path, time=T, u1_V=codes, i1_mA=np.rint(100 * I))).notes
    assert not load_waveform(mat(tmp_path, time=T, u1=codes, i1=I)).notes


def test_numbers_that_contradict_the_times_are_noted_and_codes_without_a_scale_refused(tmp_path):
    path = mat(tmp_path, t=T, u1=np.rint(U).astype("i2"), i1=np.rint(I).astype("i2"), fs=9_000.0)
    with pytest.raises(InputError, match=r"whole numbers.*--u-scale"):
        load_waveform(path)
    waveform = load_waveform(path, ChannelMap({"u1": "u1", "i1": "i1"}, u_scale=1.0, i_scale=1.0))
    assert any("9000" in note and "times count" in note for note in waveform.notes)


def test_an_attribute_that_may_be_a_scale_is_not_applied_without_a_word(tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["fs"] = RATE
        file["u1"], file["i1"] = U, I
        file["i1"].attrs["gain"] = 10.0
    assert any("gain" in note for note in load_waveform(tmp_path / "a.h5").notes)


def test_an_array_that_is_only_announced_is_refused(tmp_path):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in ("u1", "i1"):
            file.create_dataset(name, (10**9,), dtype="f8", chunks=(1000,))
    with pytest.raises(InputError, match="announces 16000 MB"):
        load_waveform(tmp_path / "a.h5")


def test_a_link_out_of_the_file_is_not_followed(tmp_path):
    import h5py

    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["u1"] = U
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["i1"] = I
        file["u1"] = h5py.ExternalLink("b.h5", "u1")
    with pytest.raises(InputError, match="i1 but no u1"):
        load_waveform(tmp_path / "a.h5", ChannelMap(rate=RATE))


def test_without_the_library_one_line_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setattr("acqd.extras.find_spec", lambda _: None)
    for ending in ("mat", "h5", "parquet", "tdms", "wfm"):
        (tmp_path / f"a.{ending}").write_bytes(b"x" * 600)
        with pytest.raises(UserError, match=r"acqd\[files\]"):
            load_waveform(tmp_path / f"a.{ending}")


def hdf(tmp_path, **datasets):
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, (values, attributes) in datasets.items():
            file.create_dataset(name.replace("__", "/"), data=values).attrs.update(attributes)
    return tmp_path / "a.h5"


@pytest.mark.parametrize("late_s", [0.0, 0.005])
def test_channels_that_begin_at_different_times_are_refused(tmp_path, late_s):
    step = {"dt": 1 / RATE}
    written = [
        mat(tmp_path, u={"time": T, "values": U}, i={"time": T + late_s, "values": I}),
        hdf(tmp_path, u1=(U, step | {"t0": 0.0}), i1=(I, step | {"t0": late_s})),
    ]
    for path in written:
        if late_s:
            with pytest.raises(InputError, match=r"begins 0\.005 s after"):
                load_waveform(path)
        assert_metered(load_waveform(path, ChannelMap(rate=RATE)) if late_s else load_waveform(path))


@pytest.mark.parametrize("rows_late", [0.5, 1.0])
def test_channels_of_a_multiplexed_converter_are_put_at_one_instant(tmp_path, rows_late):
    late_s, step = rows_late / RATE, {"dt": 1 / RATE}
    later = 5 * np.sqrt(2) * np.cos(2 * np.pi * 50 * (T + late_s) - 0.5)
    written = [
        mat(tmp_path, u={"time": T, "values": U}, i={"time": T + late_s, "values": later}),
        hdf(tmp_path, u1=(U, step | {"t0 [ms]": 1.0}), i1=(later, step | {"t0 [ms]": 1.0 + 1000 * late_s})),
        hdf(tmp_path, u1=(U, step | {"t0": 1.76e12}), i1=(later, step | {"t0": 1.76e12 + 1000 * late_s})),
    ]
    for path in written:
        assert_metered(load_waveform(path))


def test_voltages_between_lines_of_a_multiplexed_converter_are_put_at_one_instant(tmp_path):
    def wave(rms, phase, rows_late):
        return rms * np.sqrt(2) * np.cos(2 * np.pi * 50 * (T + rows_late / RATE) + phase)

    def channel(k, rms, phase):
        return {"time": T + k / 8 / RATE, "values": wave(rms, phase, k / 8)}

    third = 2 * np.pi / 3
    lines = {name: channel(k, 400, np.pi / 6 - k * third) for k, name in enumerate(("u12", "u23", "u31"))}
    amperes = {f"i{k + 1}": channel(k + 3, 5, -0.5 - k * third) for k in range(3)}
    waveform = load_waveform(mat(tmp_path, **lines, **amperes))
    batch = Meter(waveform.form).feed(SampleBlock(waveform.codes, 0, 0))
    assert float(batch.P[:, -1].sum()) == pytest.approx(np.sqrt(3) * 400 * 5 * np.cos(0.5), rel=1e-4)


def test_only_channels_that_are_metered_must_begin_together(tmp_path):
    runs = {f"run{k}": {"time": T + k, "u": U, "i": I} for k in (1, 2)}
    with pytest.raises(InputError, match="choose others with --map"):
        load_waveform(mat(tmp_path, **runs))
    assert_metered(load_waveform(mat(tmp_path, **runs), ChannelMap({"u1": "run2/u", "i1": "run2/i"})))
    heat = {"time": T + 60, "values": 20 + T}
    assert_metered(load_waveform(mat(tmp_path, t=T, u1=U, i1=I, temperature=heat)))


def test_times_that_are_no_axis_of_the_samples_shift_no_channel(tmp_path):
    response = 0.01 * np.cos(50 * T)  # s, a result
    for one in (response, np.where(T > 0.01, T, np.nan)):
        assert_metered(load_waveform(mat(tmp_path, t=T, u={"values": U}, i={"values": I, "time": one})))


def test_a_field_of_a_struct_is_the_unit_of_its_samples(tmp_path):
    channels = [{"name": "u1", "data": U / 1e3, "unit": "kV"}, {"name": "i1", "data": I * 1e3, "unit": "mA"}]
    assert_metered(load_waveform(mat(tmp_path, ch=np.array(channels, dtype=object), fs=RATE)))
    text = {"MATLAB_class": np.bytes_("char")}
    unit = np.array([[109], [65]], dtype=np.uint16)  # mA
    path = hdf(tmp_path, fs=(RATE, {}), u1__data=(U, {}), i1__data=(I * 1e3, {}), i1__unit=(unit, text))
    assert_metered(load_waveform(path))


def test_a_mark_of_missing_samples_is_no_sample(tmp_path):
    values = np.where(np.arange(len(T)) == 700, -9999.0, I)
    zero = np.where(np.abs(U) < 1.0, 0.0, U)
    assert_metered(load_waveform(hdf(tmp_path, t=(T, {}), u1=(zero, {"_FillValue": 0.0}), i1=(I, {}))))
    path = hdf(tmp_path, t=(T, {}), u1=(U, {"_FillValue": 9.97e36}), i1=(values, {"_FillValue": -9999.0}))
    with pytest.raises(InputError, match="sample 701 is marked as missing"):
        load_waveform(path)


@pytest.mark.parametrize("time", ["since", "time"])
def test_durations_of_parquet_are_times_where_nothing_else_is(tmp_path, time):
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path, since = tmp_path / "a.parquet", np.rint(T * 1e6).astype("timedelta64[us]")
    durations = {"lag": 0 * since, "time": T} if time == "time" else {"since": since}
    parquet.write_table(pyarrow.table({**durations, "u1": U, "i1": I}), path)
    assert load_waveform(path).form.rate == pytest.approx(RATE)


@pytest.mark.parametrize("key", ["calibration_factor", "conversion", "slope", "removed_offset", "LSB"])
def test_a_factor_beside_samples_is_named_whatever_its_name(tmp_path, key):
    h5py, path = pytest.importorskip("h5py"), tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, values, unit in (("time", T, "s"), ("u1", U, "V"), ("i1", I, "A")):
            file.create_dataset(name, data=values).attrs["unit"] = unit
        file["u1"].attrs[key] = 0.05
        file["i1"].attrs["gain"] = 1.0
    notes = load_waveform(path).notes
    assert [f"u1 has an attribute {key}" in note for note in notes if "is not applied" in note] == [True]


def test_a_factor_among_the_properties_of_tdms_is_named(tmp_path):
    nptdms, step = pytest.importorskip("nptdms"), {"wf_increment": 1 / RATE, "wf_start_offset": 0.5}
    channels = [
        nptdms.ChannelObject(
            "g", "U", U, step | {"unit_string": "V", "Sensitivity": 0.1, "NI_Scale[0]_Linear_Slope": 2.0}
        ),
        nptdms.ChannelObject("g", "I", I, step | {"unit_string": "A"}),
    ]
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(channels)
    notes = load_waveform(tmp_path / "a.tdms").notes
    assert [note.partition(",")[0] for note in notes] == ["U has a property Sensitivity"]


def test_what_says_nothing_of_the_size_of_samples_is_no_factor():
    keys = "duration operation calibration_date utc_offset trigger_slope time_resolution power_factor scaled xscale"
    assert not any(scales(key, 5.0) for key in keys.split())
    assert not scales("resolution", 16) and not scales("range", [-10.0, 10.0]) and not scales("multiplier", 0)
    assert all(scales(key, 5.0) for key in ("CTRatio", "y_scale", "probeGain", "range", "V_per_LSB"))
