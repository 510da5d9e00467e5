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
    ".mat": "arrays.matlab",
    ".h5": "arrays.hdf5",
    ".hdf5": "arrays.hdf5",
    ".hdf": "arrays.hdf5",
    ".parquet": "arrays.parquet",
    ".arrow": "arrays.parquet",
    ".feather": "arrays.parquet",
    ".tdms": "arrays.tdms",
    ".trc": "scopes.lecroy",
    ".isf": "scopes.tektronix",
    ".wfm": "scopes.library",
    ".bin": "scopes.library",
}

_ELSEWHERE = {
    ".pqd": "PQDIF is not read; export COMTRADE or CSV in the analyser's software",
    ".pqdif": "PQDIF is not read; export COMTRADE or CSV in the analyser's software",
    ".psdata": "PicoScope .psdata is not read; File > Save as > CSV or MATLAB in PicoScope",
    ".dxd": "Dewesoft .dxd is not read; export text/CSV or MATLAB in DewesoftX",
    ".d7d": "Dewesoft .d7d is not read; export text/CSV or MATLAB in DewesoftX",
    ".wdf": "Yokogawa .wdf is not read; save as ASCII (.csv) or convert it in XviewerLITE",
    ".wvf": "Yokogawa .wvf is not read; save as ASCII (.csv) in the instrument",
    ".hdr": "Yokogawa .hdr with .wvf is not read; save as ASCII (.csv) in the instrument",
    ".tdm": "TDM is not read; convert it to .tdms in DIAdem, or with LabVIEW's storage VIs",
    ".mf4": "MDF is not read; export .mat or Parquet (asammdf: mdf.export('parquet'))",
    ".mdf": "MDF is not read; export .mat or Parquet (asammdf: mdf.export('parquet'))",
    ".mem": "HIOKI .mem is not read; save as text (.csv) in the instrument",
    ".xlsx": "spreadsheets are not read; save the sheet as CSV",
    ".xls": "spreadsheets are not read; save the sheet as CSV",
}
"""Files of instruments without a reader, and what to export instead."""
_PACKED = {b"\x1f\x8b": "gzip", b"PK\x03\x04": "ZIP", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"\x28\xb5\x2f\xfd": "zstd"}
"""First bytes of compressed files."""
_PACKED_ENDINGS = (".gz", ".zip", ".bz2", ".xz", ".zst", ".7z")


def load_waveform(path: Path, given: ChannelMap | None = None) -> Waveform:
    """Read a recorded waveform. Raises InputError, naming what is wrong with the file."""
    given = given or ChannelMap()
    return waveform_of(load_recording(path, given), given)


def load_recording(path: Path, given: ChannelMap) -> Recording:
    """Read a file as channels and a clock, before anybody decides which are metered. Raises InputError."""
    if path.is_dir():
        raise InputError(path, "is a folder; name a waveform file in it")
    ending = path.suffix.lower()
    if ending in _ELSEWHERE:
        raise InputError(path, _ELSEWHERE[ending])
    if ending in _PACKED_ENDINGS:
        raise InputError(path, f"is compressed ({ending[1:]}); unpack it first")
    module = _LOADERS.get(ending)
    if module is None:
        known = " ".join(sorted(_LOADERS))
        raise InputError(path, f"unknown kind of waveform file; known endings: {known}")
    if not path.exists():
        raise InputError(path, "no such file")
    if path.stat().st_size == 0:
        raise InputError(path, "is empty")
    try:
        with path.open("rb") as file:
            packed = next((name for mark, name in _PACKED.items() if file.peek(8).startswith(mark)), "")
        if packed and ending != ".npz":
            raise InputError(path, f"is compressed ({packed}); unpack it first")
        recording: Recording = import_module(f"acqd.sources.{module}").load(path, given)
    except PermissionError:
        raise InputError(path, "may not be read by this user; check its permissions") from None
    return recording
