"""TDMS files of LabVIEW and FlexLogger, through npTDMS."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.extras import require
from acqd.sources.arrays.channels import recording_of
from acqd.sources.arrays.contents import Contents, check_size, damaged
from acqd.sources.arrays.factors import not_applied, scales
from acqd.sources.recording.channel import Recording
from acqd.sources.waveform import ChannelMap

_ADVICE = "write waveforms with the properties wf_increment and unit_string"


def load(path: Path, given: ChannelMap) -> Recording:
    """Channels with unit (`unit_string`), step (`wf_increment`) and start (`wf_start_time`). Raises InputError.

    Values are those that the scalings in the file give.
    """
    require("TDMS files", ["nptdms"], "files")
    from nptdms import TdmsFile

    contents = Contents()
    try:
        with _warnings(contents.notes), TdmsFile.open(path) as file:
            channels = [channel for group in file.groups() for channel in group.channels()]
            check_size(path, sum(8 * len(channel) for channel in channels))
            several = len({channel.name for channel in channels}) < len(channels)
            whole = not contents.notes
            for channel in channels:
                alike = [len(one) for one in channels if _step(one) == _step(channel)]
                length = len(channel) if whole else min(filter(None, alike), default=0)
                _add(contents, path, channel, several, length)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes npTDMS raise
        raise damaged(path, "TDMS file", error) from None
    return recording_of(path, "TDMS", contents, given, _ADVICE)


class _Notes(logging.Handler):
    """Keeps what npTDMS logs, each sentence once."""

    def __init__(self, notes: list[str]) -> None:
        super().__init__(logging.WARNING)
        self._notes = notes

    def emit(self, record: logging.LogRecord) -> None:
        """A line of the log."""
        text = f"npTDMS: {record.getMessage().splitlines()[0][:200]}"
        if text not in self._notes:
            self._notes.append(text)


@contextmanager
def _warnings(notes: list[str]) -> Iterator[None]:
    """What npTDMS would print, such as that the last segment is not whole, becomes notes."""
    from nptdms.log import log_manager

    loggers = list(log_manager.loggers.values())
    before = [(log.handlers, log.propagate) for log in loggers]
    handler = _Notes(notes)
    for log in loggers:
        log.handlers, log.propagate = [handler], False
    try:
        yield
    finally:
        for log, (handlers, propagate) in zip(loggers, before, strict=True):
            log.handlers, log.propagate = handlers, propagate


def _step(channel: Any) -> Any:
    return channel.properties.get("wf_increment")


def _add(contents: Contents, path: Path, channel: Any, several: bool, length: int) -> None:
    """A channel; of a file whose end is missing, so much of it as all channels of its rate have."""
    properties, step = channel.properties, _step(channel)
    start = properties.get("wf_start_time")
    kind = np.dtype(channel.dtype).kind
    if kind not in "iufM" or len(channel) < length or not length:
        return
    offset = properties.get("wf_start_offset", 0.0)
    # npTDMS applies the scales of NI itself.
    factors = [key for key, value in properties.items() if not key.startswith("NI_") and scales(key, value)]
    if factors:
        contents.notes.append(not_applied(channel.name, f"a property {factors[0]}"))
    utc = None if start is None else _utc_ns(start) + round(float(offset) * 1e9)
    contents.add(
        f"{channel.group_name}/{channel.name}" if several else channel.name,
        (length,),
        _reader(path, channel.group_name, channel.name, length),
        str(properties.get("unit_string", "") or properties.get("Unit", "")),
        step_s=float(step) if step and 0 < float(step) < 1e6 else None,
        start_utc_ns=utc if utc and utc > 0 else None,
        unapplied=bool(factors),
    )


def _utc_ns(start: Any) -> int:
    return int(np.datetime64(start).astype("datetime64[ns]").astype(np.int64))


def _reader(path: Path, group: str, name: str, length: int) -> Any:
    def read() -> Any:
        from nptdms import TdmsFile

        with _warnings([]), TdmsFile.open(path) as file:
            return np.asarray(file[group][name][:length])

    return read
