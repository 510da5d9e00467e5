"""COMTRADE recordings (IEEE C37.111) through the `comtrade` package."""

from __future__ import annotations

import re
import warnings
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import comtrade
import numpy as np

from acqd.errors import InputError
from acqd.sources.waveform import ChannelMap, Waveform, quantise

_UNITS = {
    **{
        name: ("u", factor)
        for factor, names in ((1.0, "v volt volts"), (1e3, "kv"), (1e-3, "mv"))
        for name in names.split()
    },
    **{
        name: ("i", factor)
        for factor, names in ((1.0, "a amp ampere amperes"), (1e3, "ka"), (1e-3, "ma"))
        for name in names.split()
    },
}
_PHASES = {"a": "1", "l1": "1", "r": "1", "1": "1", "b": "2", "l2": "2", "s": "2", "2": "2", "c": "3", "l3": "3"}
_PHASES |= {"t": "3", "3": "3"}
_LEAST_BYTES = 4  # of a sample's row: its number, its time and one value with their separators
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def load(path: Path, channels: ChannelMap) -> Waveform:
    """CFG + DAT (give either) or CFF. Channels by unit and phase, or by --map with their names.

    The recorder's local time is taken as UTC: the format has no time zone before 2013.
    Raises InputError.
    """
    record = _read(path)
    names = [channel.name.strip() for channel in record.cfg.analog_channels]
    pairs = channels.pairs(path, _by_unit(record.cfg.analog_channels))
    columns = []
    for pair in pairs:
        for name, given in zip(pair, (channels.u_scale, channels.i_scale), strict=True):
            if name not in names:
                raise InputError(path, f"has no analog channel {name!r}; channels are {', '.join(names)}")
            number = names.index(name)
            unit = record.cfg.analog_channels[number].uu.strip().lower()
            factor = given or _UNITS.get(unit, ("", 1.0))[1]
            columns.append(np.asarray(record.analog[number], dtype=np.float64) * factor)
    values = np.column_stack(columns)
    rates = record.cfg.sample_rates
    if len(rates) > 1 and channels.rate is None:
        steps = ", ".join(f"{rate:g} Hz" for rate, _ in rates)
        raise InputError(path, f"changes its sampling rate ({steps}); one constant rate is needed")
    rate = channels.rate or float(rates[0][0])
    if not rate:
        time = np.asarray(record.time)
        rate = float((len(time) - 1) / (time[-1] - time[0])) if len(time) > 1 and time[-1] > time[0] else 0.0
    f_nominal = channels.f_nominal or _nominal(float(record.cfg.frequency or 50.0))
    return quantise(path, values, rate, f_nominal, _utc_ns(record.cfg.start_timestamp))


def _read(path: Path) -> Any:
    # numpy's zeros take no memory before they are filled, however many samples a damaged header announces
    record = comtrade.Comtrade(ignore_warnings=True, use_numpy_arrays=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if path.suffix.lower() == ".cff":
                record.load(str(path))
            else:
                record.load(str(_sibling(path, ".cfg")), str(_sibling(path, ".dat")))
    except (InputError, PermissionError):
        raise
    except Exception as error:  # whatever a damaged recording makes the library raise
        raise InputError(path, f"is no readable COMTRADE recording ({type(error).__name__}: {error})") from None
    expected = record.cfg.sample_rates[-1][1] if record.cfg.sample_rates else 0
    got = 0 if record.time is None else len(record.time)
    data = _sibling(path, ".dat") if path.suffix.lower() != ".cff" else path
    if record.cfg.ft.upper().startswith("BIN") and data.suffix.lower() == ".dat":
        size = 8 + 2 * len(record.cfg.analog_channels) + 2 * ((len(record.cfg.status_channels) + 15) // 16)
        got = min(got, data.stat().st_size // size) if record.cfg.ft.upper() == "BINARY" else got
    if not got or not record.cfg.sample_rates:
        raise InputError(path, "has no samples")
    got = min(got, data.stat().st_size // _LEAST_BYTES)
    if expected and got < expected:
        raise InputError(path, f"is truncated: {got} of {expected} samples")
    return record


def _sibling(path: Path, suffix: str) -> Path:
    """The other file of the pair, in whichever case it is written."""
    for candidate in (path.with_suffix(suffix), path.with_suffix(suffix.upper())):
        if candidate.exists():
            return candidate
    raise InputError(path, f"lacks its {suffix} file next to it")


def _by_unit(channels: list[Any]) -> dict[str, str]:
    """u1, i1 ... by unit, and by the phase the file declares or the name ends in."""
    found: dict[str, str] = {}
    for channel in channels:
        kind = _UNITS.get(channel.uu.strip().lower())
        if kind is None:
            continue
        declared = channel.ph.strip().lower()
        ending = re.search(r"(l?[123]|[abcrst])$", channel.name.strip().lower())
        phase = _PHASES.get(declared) or (_PHASES.get(ending.group(1)) if ending else None)
        if phase and f"{kind[0]}{phase}" not in found:
            found[f"{kind[0]}{phase}"] = channel.name.strip()
    return found


def _nominal(f: float) -> float:
    return f if 45 <= f <= 65 else 50.0


def _utc_ns(stamp: datetime | None) -> int | None:
    if stamp is None or stamp.year < 1971:
        return None
    delta = stamp.replace(tzinfo=UTC) - _EPOCH
    return (delta.days * 86_400 + delta.seconds) * 1_000_000_000 + delta.microseconds * 1000
