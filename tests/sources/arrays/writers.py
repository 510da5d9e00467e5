"""Recordings as programs write them: MATLAB, HDF5, Parquet, Arrow, TDMS."""

from __future__ import annotations

import numpy as np

RATE = 10_000.0
T = np.arange(2_000) / RATE
U = 230 * np.sqrt(2) * np.cos(2 * np.pi * 50 * T)
I = 5 * np.sqrt(2) * np.cos(2 * np.pi * 50 * T - 0.5)  # noqa: E741
START_NS = 1_687_342_500_000_000_000


def matlab(path, variables, **options):
    from scipy.io import savemat

    savemat(path, variables, **options)


def mat_columns(folder):
    """Variables of a script, as columns."""
    matlab(folder / "a.mat", {"t": T[:, None], "u1": U[:, None], "i1": I[:, None], "comment": "press 1"})


def mat_struct(folder):
    """One struct, compressed, with a rate instead of times and a unit in the names."""
    matlab(folder / "a.mat", {"data": {"u1_mV": U * 1e3, "i1_A": I, "Fs": RATE}}, do_compression=True)


def mat_matrix(folder):
    """A matrix with the names of its columns in a cell array."""
    names = np.array(["time [ms]", "UL1", "IL1"], dtype=object)
    matlab(folder / "a.mat", {"channels": names, "data": np.column_stack([T * 1e3, U, I])})


def mat_simulink(folder):
    """A structure with time: the label of a signal is its name."""
    signals = np.array([({"label": "Voltage L1", "values": U}), ({"label": "Current L1", "values": I})], dtype=object)
    matlab(folder / "a.mat", {"ScopeData": {"time": T, "signals": signals}})


def mat_picoscope(folder):
    """PicoScope's export: single precision, start, interval and length as numbers."""
    content = {"A": U.astype("f4"), "B": I.astype("f4"), "Tstart": -0.1, "Tinterval": 1 / RATE, "Length": float(len(T))}
    matlab(folder / "a.mat", content)


def mat_level_4(folder):
    """The format of MATLAB 4."""
    matlab(folder / "a.mat", {"time": T, "u1": U, "i1": I}, format="4")


def mat_73(folder):
    """MATLAB 7.3: HDF5 behind a block of 512 bytes, vectors as 1 x n."""
    import h5py

    path = folder / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t", T), ("u1", U), ("i1", I)):
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))


def hdf5_attributes(folder):
    """Groups, compressed codes with scale and offset of the CF conventions, unit and rate as attributes."""
    import h5py

    with h5py.File(folder / "a.h5", "w") as file:
        group = file.create_group("feeder")
        group.attrs["sample_rate"] = RATE
        for name, values, unit in (("u1", U, "V"), ("i1", I * 1e3, "mA")):
            scale = np.abs(values).max() / 32_000
            dataset = group.create_dataset(name, data=np.rint(values / scale).astype("i2"), compression="gzip")
            dataset.attrs.update(unit=unit, scale_factor=scale, add_offset=0.0)


def hdf5_table(folder):
    """A table of records."""
    import h5py

    table = np.zeros(len(T), dtype=[("time", "f8"), ("u1", "f4"), ("i1", "f4")])
    table["time"], table["u1"], table["i1"] = T, U, I
    with h5py.File(folder / "a.h5", "w") as file:
        file["samples"] = table


def parquet_stamps(folder):
    """A column of time stamps, single precision, the units in the names."""
    import pyarrow
    from pyarrow import parquet

    stamps = pyarrow.array(START_NS + np.rint(T * 1e9).astype("i8"), pyarrow.timestamp("ns"))
    columns = {"timestamp": stamps, "u1 [V]": U.astype("f4"), "i1 [A]": I.astype("f4")}
    parquet.write_table(pyarrow.table(columns), folder / "a.parquet", compression="zstd")


def arrow_file(folder):
    """Feather: Arrow's file format."""
    import pyarrow
    from pyarrow import feather

    feather.write_feather(pyarrow.table({"t_s": T, "u1": U, "i1_mA": I * 1e3}), folder / "a.feather")


def arrow_stream(folder):
    """Arrow's stream format, units in the metadata."""
    import pyarrow

    unit = pyarrow.field("i1", pyarrow.float64(), metadata={"unit": "kA"})
    schema = pyarrow.schema([("time", pyarrow.float64()), ("u1", pyarrow.float64()), unit])
    table = pyarrow.table([T, U, I / 1e3], schema=schema)
    with pyarrow.OSFile(str(folder / "a.arrow"), "wb") as sink, pyarrow.ipc.new_stream(sink, schema) as writer:
        writer.write_table(table)


def tdms(folder):
    """Waveforms of LabVIEW: step, start and unit as properties."""
    from nptdms import ChannelObject, TdmsWriter

    start = np.datetime64(START_NS, "ns").astype("datetime64[us]")
    properties = {"wf_increment": 1 / RATE, "wf_start_time": start, "wf_start_offset": 0.0}
    half = len(T) // 2
    with TdmsWriter(folder / "a.tdms") as writer:
        for part in (slice(None, half), slice(half, None)):
            channels = [
                ChannelObject("Untitled", name, values[part], properties | {"unit_string": unit})
                for name, values, unit in (("Voltage_L1", U, "V"), ("Current_L1", I * 1e3, "mA"))
            ]
            slow = ChannelObject("Untitled", "Temperature", np.full(20, 23.5), {"wf_increment": 0.01})
            writer.write_segment([slow, *channels])


WRITERS = {
    "columns": mat_columns, "struct": mat_struct, "matrix": mat_matrix, "simulink": mat_simulink,
    "level 4": mat_level_4, "7.3": mat_73, "attributes": hdf5_attributes, "table": hdf5_table,
    "parquet": parquet_stamps, "feather": arrow_file, "stream": arrow_stream, "tdms": tdms,
}  # fmt: skip
