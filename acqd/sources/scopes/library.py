"""Binary files of Rigol, Keysight, Siglent, Yokogawa, Rohde & Schwarz and old ones of Tektronix, through RigolWFM.

RigolWFM calls every trace of Tektronix, Yokogawa and Rohde & Schwarz a voltage, so their unit is unknown (ADR 38).
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

from acqd.errors import InputError
from acqd.extras import require
from acqd.sources.arrays.contents import check_size, damaged
from acqd.sources.recording.channel import Recording
from acqd.sources.scopes import tektronix_wfm
from acqd.sources.scopes.shot import Trace, check_step, recording_of
from acqd.sources.scopes.tektronix_wfm import is_tektronix
from acqd.sources.waveform import ChannelMap

_UNITS = {"v": "V", "volts": "V", "a": "A", "amps": "A", "amperes": "A", "w": "W", "watts": "W"}
_SILENT = ("yokogawa_wfm", "yokogawa_wvf", "rohde_schwarz_bin", "tek_wfm")
"""Families whose unit the library does not read."""
_EXPANDED = 11  # bytes of memory for a byte of the file, in the families that hold float32 numbers


def load(path: Path, given: ChannelMap) -> Recording:
    """All analog traces of the file. Raises InputError."""
    del given
    if is_tektronix(path):
        return recording_of(path, "Tektronix .wfm", tektronix_wfm.read)
    require("binary files of oscilloscopes (.wfm, .bin)", ["RigolWFM"], "files")
    return recording_of(path, "oscilloscope, binary", _read)


def _read(path: Path) -> list[Trace]:
    check_size(path, _EXPANDED * path.stat().st_size)
    said = io.StringIO()
    try:
        from RigolWFM.wfm import Wfm

        from acqd.sources.scopes.lean import lean_channels

        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said), lean_channels():
            file = Wfm.from_file(str(path))
            channels = [one for one in file.channels if one.codes is not None and one.points > 0]
            traces = [_trace(path, one, file.parser_name) for one in channels]
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes the library raise
        raise damaged(path, "oscilloscope file that is known; save as .csv in the instrument", error) from None
    if not traces:
        raise InputError(path, "holds no analog trace; save as .csv in the instrument")
    return traces


def _trace(path: Path, channel: Any, family: str) -> Trace:
    step = check_step(path, float(channel.seconds_per_point))
    unit = _UNITS.get(str(getattr(channel.unit, "name", "")).lower(), "")
    if family in _SILENT:
        unit = ""
    name = channel.name.replace(" ", "")
    codes = channel.codes
    return Trace(name, unit, len(codes), lambda: codes, channel.factor, channel.zero, step, channel.origin_s)
