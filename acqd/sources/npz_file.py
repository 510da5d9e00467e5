"""NPZ recordings: converter codes and scales, as an EL3783 delivers them, or volts and amperes."""

from __future__ import annotations

import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.sources.arrays.channels import recording_of
from acqd.sources.arrays.contents import Contents
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.waveform import LATEST_NS, MOST_BYTES, QUANTITIES, ChannelMap

_KEYS = ("u_code", "i_code", "u_V_per_digit", "i_A_per_digit", "fs")
_EARLIEST_NS = 10**16
"""April 1970: microseconds of this century are less."""
_PHYSICAL = ("u_V", "i_A", "fs")
_DAMAGED = "is truncated or no NPZ file; record or copy it again, or save with numpy.savez"
_OBJECTS = "holds Python objects (dtype object), which are not read; save arrays of numbers with numpy.savez"


def load(path: Path, given: ChannelMap) -> Recording:
    """`u_code`, `i_code` int16 [phase, sample], `u_V_per_digit`, `i_A_per_digit`, `fs` [1/s].

    The scales are one number, or one per phase. Instead of codes and scales: `u_V`, `i_A` float [phase, sample].
    Optional: `f_nominal` [Hz], `start_utc_ns`, `simulated` (not 0: flags every row); `u_unit`, `i_unit` for other units
    than V and A. Raises InputError.
    """
    data = _with_rate(path, _read(path))
    if not any(key in data for key in (*_KEYS[:2], *_PHYSICAL[:2])):
        return _named(path, data, given)
    physical = "u_V" in data and "u_code" not in data
    missing = [key for key in (_PHYSICAL if physical else _KEYS) if key not in data]
    if missing:
        raise InputError(path, f"lacks {', '.join(missing)}; has {', '.join(sorted(data)) or 'nothing'}")
    names = _PHYSICAL[:2] if physical else _KEYS[:2]
    u, i = (_by_phase(_values(path, key, data[key]) if physical else _codes(path, key, data[key])) for key in names)
    if u.shape != i.shape:
        shapes = f"{names[0]} {u.shape} and {names[1]} {i.shape}"
        raise InputError(path, f"{shapes} differ; expected the same [phase, sample]")
    phases, samples = u.shape
    if not 1 <= phases <= 3:
        raise InputError(path, f"{names[0]} has {phases} phases, expected 1 to 3 as [phase, sample]")
    if not samples:
        raise InputError(path, "has no samples")
    units = {key: _unit(data, key) for key in names}
    scales = [1.0] * (2 * phases)
    if not physical:
        scales[0::2] = _per_phase(path, data, "u_V_per_digit", phases)
        scales[1::2] = _per_phase(path, data, "i_A_per_digit", phases)
    channels = [Channel(QUANTITIES[k], units[names[k % 2]]) for k in range(2 * phases)]

    def column(k: int) -> Column:
        return Column((i if k % 2 else u)[k // 2], scales[k])

    f_nominal = _number(path, data, "f_nominal") if "f_nominal" in data else None
    rate = _number(path, data, "fs")
    start = _integer(path, data, "start_utc_ns") if "start_utc_ns" in data else None
    if start is not None and not 0 <= start < LATEST_NS:
        raise InputError(path, f"start_utc_ns {start} is no time between 1970 and 2200")
    if start is not None and 0 < start < _EARLIEST_NS:
        raise InputError(path, f"start_utc_ns {start} is {start * 1e-9:g} s after 1970; expected nanoseconds")
    simulated = "simulated" in data and _number(path, data, "simulated") != 0
    return Recording(
        path, "NPZ of " + ("values" if physical else "codes"), channels, samples, column, rate, start, f_nominal,
        simulated, noun="channel", full_scale=not physical, declared=True,
    )  # fmt: skip


def _by_phase(array: np.ndarray) -> np.ndarray:
    """[phase, sample], also of [sample, phase]: no recording has more phases than samples."""
    return array.T if array.shape[1] <= 3 < array.shape[0] else array


def _with_rate(path: Path, data: dict[str, Any]) -> dict[str, Any]:
    """With `fs`, where the file has the step `dt` [s]."""
    if "fs" in data or "dt" not in data:
        return data
    step = _number(path, data, "dt")
    return data | {"fs": np.array(1 / step)} if step > 0 else data


def _named(path: Path, data: dict[str, Any], given: ChannelMap) -> Recording:
    """Arrays of other names. Raises InputError."""
    contents = Contents()
    for key, array in data.items():
        if array.dtype.kind in "iuf" and array.size == 1:
            contents.numbers[key] = float(array.reshape(()))
        elif array.dtype.kind in "iuf":
            contents.add(key, array.shape, partial(data.__getitem__, key))
        elif array.dtype.kind == "c":
            contents.notes.append(f"{key} holds complex numbers, expected real ones: left out")
    return recording_of(path, "NPZ of named arrays", contents, given, "save u_V, i_A and fs with numpy.savez")


def _unit(data: dict[str, Any], key: str) -> str:
    """V or A, unless an array such as `u_unit` says otherwise."""
    said = data.get(f"{key[0]}_unit")
    return (
        "VA"[key[0] == "i"] if said is None or said.dtype.kind not in "US" or said.size != 1 else str(said.reshape(()))
    )


def _read(path: Path) -> dict[str, Any]:
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MOST_BYTES:
            raise InputError(path, f"holds {size / 1e9:.1f} GB unpacked; expected at most {MOST_BYTES / 1e9:.1f} GB")
        with np.load(path, allow_pickle=False) as file:
            data = {key: file[key] for key in file.files}
    except InputError:
        raise
    except MemoryError:
        raise InputError(path, "announces arrays that are larger than the memory") from None
    except ValueError as error:
        if "allow_pickle" in str(error):
            raise InputError(path, _OBJECTS) from None
        raise InputError(path, _DAMAGED) from None
    except Exception:  # whatever a damaged archive makes zipfile, zlib and numpy raise
        raise InputError(path, _DAMAGED) from None
    odd = next((key for key, array in data.items() if not isinstance(array, np.ndarray)), None)
    if odd is not None:  # numpy hands out members that are no arrays as bytes
        raise InputError(path, f"{odd} is no array of numpy")
    return data


def _codes(path: Path, key: str, array: Any) -> np.ndarray:
    if array.dtype.kind not in "iuf" or array.ndim not in (1, 2):
        raise InputError(path, f"{key} is {array.dtype} {array.shape}, expected int16 [phase, sample]")
    array = np.atleast_2d(array)
    if not np.isfinite(array).all():
        raise InputError(path, f"{key} holds NaN or infinity, expected int16 codes")
    if array.size and (array.min() < -32768 or array.max() > 32767 or (array != np.rint(array)).any()):
        raise InputError(path, f"{key} holds values that are no int16 codes; store codes and scales apart")
    return np.asarray(array.astype(np.int16))


def _values(path: Path, key: str, array: Any) -> np.ndarray:
    if array.dtype.kind not in "iuf" or array.ndim not in (1, 2):
        raise InputError(path, f"{key} is {array.dtype} {array.shape}, expected numbers [phase, sample]")
    return np.atleast_2d(array).astype(np.float64)


def _per_phase(path: Path, data: dict[str, Any], key: str, phases: int) -> list[float]:
    if key not in data:
        return [1.0] * phases
    array = data[key]
    if array.size == 1:
        return [_number(path, data, key)] * phases
    if array.size != phases or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        raise InputError(
            path, f"{key} is {array!r:.60}, expected one finite number, or one for each of {phases} phases"
        )
    return [float(scale) for scale in array.ravel()]


def _integer(path: Path, data: dict[str, Any], key: str) -> int:
    """A number that may need more digits than a float has."""
    value = int(_number(path, data, key))
    return value if data[key].dtype.kind == "f" else int(data[key].reshape(()))


def _number(path: Path, data: dict[str, Any], key: str) -> float:
    array = data[key]
    if array.size != 1 or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        raise InputError(path, f"{key} is {array!r:.60}, expected one finite number")
    return float(array.reshape(()))
