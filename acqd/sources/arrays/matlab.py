"""MATLAB files: level 4 and 5 through SciPy, 7.3 (which is HDF5) through h5py."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.extras import require
from acqd.sources.arrays import hdf5
from acqd.sources.arrays.channels import recording_of
from acqd.sources.arrays.contents import Contents, check_size, damaged, scalar
from acqd.sources.arrays.factors import not_applied, scales
from acqd.sources.arrays.mat_elements import check_elements
from acqd.sources.recording.channel import Recording
from acqd.sources.waveform import ChannelMap

_DEEPEST = 6  # structs within structs
_WIDEST = 64  # elements of an array of structs
_OBJECTS = "tables, timetables and objects are not read: save(..., '-struct') of table2struct(T, 'ToScalar', true)"
_ADVICE = "save the arrays with save('file.mat', 'time', 'u1', 'i1')"


def load(path: Path, given: ChannelMap) -> Recording:
    """Arrays by the names of their variables; fields of structs as `struct/field`. Raises InputError."""
    with path.open("rb") as file:
        head = file.read(520)
    if head.startswith(b"MATLAB 7.3") or head[512:] == hdf5.SIGNATURE or head.startswith(hdf5.SIGNATURE):
        return hdf5.load(path, given)
    require("MATLAB files (.mat)", ["scipy"], "files")
    from scipy.io import loadmat, whosmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of duplicate names
            check_elements(path)
            held = whosmat(path)
            check_size(path, sum(8 * _size(shape) for _, shape, _ in held))
            variables = loadmat(path, struct_as_record=False, verify_compressed_data_integrity=True)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes SciPy raise
        raise damaged(path, "MATLAB file", error) from None
    contents = Contents()
    logical = {name for name, _, kind in held if kind == "logical"}  # SciPy makes small integers of them
    _collect_texts(contents, variables)
    for name, value in variables.items():
        if not name.startswith("__") and name not in logical:
            _add(contents, name, value)
    return recording_of(path, "MATLAB", contents, given, _ADVICE)


def _size(shape: tuple[int, ...]) -> int:
    size = 1
    for one in shape:
        size *= int(one)
    return size


def _collect_texts(contents: Contents, variables: dict[str, Any]) -> None:
    """Cell arrays of texts: names of the columns of a matrix."""
    for name, value in variables.items():
        if isinstance(value, np.ndarray) and value.dtype == object and 1 < value.size <= _WIDEST:
            texts = [_text(one) for one in value.reshape(-1)]
            if all(texts):
                contents.names[name] = texts


def _text(value: Any) -> str:
    """The text in a char array; empty for anything else."""
    array = np.asarray(value)
    return str(array.reshape(-1)[0]).strip() if array.dtype.kind == "U" and array.size == 1 else ""


def _add(contents: Contents, name: str, value: Any, depth: int = 0, unit: str = "", *, unapplied: bool = False) -> None:
    """One variable, with what is in it; `unit` and `unapplied` as the struct around it says."""
    if depth > _DEEPEST:
        return
    if hasattr(value, "_fieldnames"):
        _add_struct(contents, name, value, depth)
        return
    array = value if isinstance(value, np.ndarray) else np.asarray(value)
    if type(value).__name__ in ("MatlabOpaque", "MatlabFunction", "MatlabObject"):
        contents.notes.append(f"{name}: {_OBJECTS}")
    elif array.dtype == object:
        items = array.reshape(-1)[:_WIDEST]
        for k, item in enumerate(items):
            _add(contents, f"{name}{k + 1}" if array.size > 1 else name, item, depth + 1, unit, unapplied=unapplied)
    elif array.dtype.kind in "iuf":
        number = scalar(array)
        if number is not None:
            contents.numbers[name] = number
        elif array.size > 1:
            contents.add(name, array.shape, lambda: array, unit, unapplied=unapplied)
    elif array.dtype.kind == "c":
        contents.notes.append(f"{name} is complex: no samples")


def _add_struct(contents: Contents, name: str, struct: Any, depth: int) -> None:
    """Fields; of a Simulink signal (`values`, `label`) the label is the name. A field `unit` is that of the samples."""
    fields = {field: getattr(struct, field) for field in struct._fieldnames}
    label = _text(fields.get("label", "")) or _text(fields.get("name", ""))
    unit = next((_text(value) for field, value in fields.items() if field.lower() in hdf5.UNITS), "")
    scaled = next((field for field, value in fields.items() if scales(field, value)), "")
    if scaled and any(field.lower() in hdf5.SAMPLES for field in fields):
        contents.notes.append(not_applied(name, f"a field {scaled}"))
    for field, value in fields.items():
        own = label if label and field.lower() in ("values", "data") else f"{name}/{field}"
        samples = field.lower() in hdf5.SAMPLES
        _add(contents, own, value, depth + 1, unit if samples else "", unapplied=samples and bool(scaled))
