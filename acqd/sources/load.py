"""Pick the loader by the file's ending; only the one needed is imported."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from acqd.errors import InputError
from acqd.sources.recording.build import waveform_of
from acqd.sources.recording.channel import Recording
from acqd.sources.waveform import ChannelMap, Waveform

_LOADERS = {
    ".npz": "npz_file",
    ".csv": "text",
    ".txt": "text",
    ".tsv": "text",
    ".asc": "text",
    ".lvm": "text",
    ".wav": "audio_file",
    ".flac": "audio_file",
    ".cfg": "comtrade",
    ".dat": "comtrade",
    ".cff": "comtrade",
}

_ELSEWHERE = {
    ".mat": "MATLAB files are not read; write CSV, or NPZ with numpy.savez(path, u_V=..., i_A=..., fs=...)",
    ".tdms": "TDMS is not read; export .lvm or CSV in LabVIEW",
    ".h5": "HDF5 is not read; write NPZ with numpy.savez(path, u_V=..., i_A=..., fs=...)",
    ".hdf5": "HDF5 is not read; write NPZ with numpy.savez(path, u_V=..., i_A=..., fs=...)",
    ".parquet": "Parquet is not read; write CSV with time, u1, i1 ...",
    ".pqd": "PQDIF is not read; export COMTRADE or CSV in the analyser's software",
    ".isf": "Tektronix .isf is not read; save as .csv in the oscilloscope (Save > Waveform > .csv)",
    ".wfm": "oscilloscope .wfm is not read; save as .csv in the oscilloscope",
    ".trc": "LeCroy .trc is not read; save as ASCII or MATLAB in the oscilloscope",
    ".psdata": "PicoScope .psdata is not read; File > Save as > CSV or MATLAB in PicoScope",
    ".dxd": "Dewesoft .dxd is not read; export text/CSV or MATLAB in DewesoftX",
    ".d7d": "Dewesoft .d7d is not read; export text/CSV or MATLAB in DewesoftX",
    ".wdf": "Yokogawa .wdf is not read; save as ASCII (.csv) or convert it in XviewerLITE",
    ".wvf": "Yokogawa .wvf is not read; save as ASCII (.csv) in the instrument",
    ".mem": "HIOKI .mem is not read; save as text (.csv) in the instrument",
    ".bin": "binary oscilloscope files are not read; save as .csv in the instrument",
    ".xlsx": "spreadsheets are not read; save the sheet as CSV",
    ".xls": "spreadsheets are not read; save the sheet as CSV",
}
"""Files of instruments without a reader, and what to export instead."""


def load_waveform(path: Path, given: ChannelMap | None = None) -> Waveform:
    """Read a recorded waveform. Raises InputError, naming what is wrong with the file."""
    given = given or ChannelMap()
    return waveform_of(load_recording(path, given), given)


def load_recording(path: Path, given: ChannelMap) -> Recording:
    """Read a file as channels and a clock, before anybody decides which are metered. Raises InputError."""
    ending = path.suffix.lower()
    if ending in _ELSEWHERE:
        raise InputError(path, _ELSEWHERE[ending])
    module = _LOADERS.get(ending)
    if module is None:
        known = " ".join(sorted(_LOADERS))
        raise InputError(path, f"unknown kind of waveform file; known endings: {known}")
    if not path.exists():
        raise InputError(path, "no such file")
    if path.is_dir():
        raise InputError(path, "is a folder, expected a waveform file")
    if path.stat().st_size == 0:
        raise InputError(path, "is empty")
    try:
        recording: Recording = import_module(f"acqd.sources.{module}").load(path, given)
    except PermissionError:
        raise InputError(path, "may not be read by this user; check its permissions") from None
    return recording
