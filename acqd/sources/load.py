"""Pick the loader by the file's ending; only the one needed is imported."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from acqd.errors import InputError
from acqd.sources.waveform import ChannelMap, Waveform

_LOADERS = {
    ".npz": "npz_file",
    ".csv": "csv_file",
    ".txt": "csv_file",
    ".tsv": "csv_file",
    ".wav": "audio_file",
    ".flac": "audio_file",
    ".cfg": "comtrade",
    ".dat": "comtrade",
    ".cff": "comtrade",
}


def load_waveform(path: Path, channels: ChannelMap | None = None) -> Waveform:
    """Read a recorded waveform. Raises InputError, naming what is wrong with the file."""
    module = _LOADERS.get(path.suffix.lower())
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
        waveform: Waveform = import_module(f"acqd.sources.{module}").load(path, channels or ChannelMap())
    except PermissionError:
        raise InputError(path, "may not be read by this user; check its permissions") from None
    return waveform
