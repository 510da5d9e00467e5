"""HDF5 files, and those of MATLAB 7.3: datasets by name, with what their attributes say of unit, rate and scale."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.extras import require
from acqd.sources.arrays.channels import recording_of
from acqd.sources.arrays.contents import Contents, check_size, damaged, scalar
from acqd.sources.arrays.factors import not_applied, scales
from acqd.sources.recording.channel import Recording
from acqd.sources.waveform import ChannelMap

SIGNATURE = b"\x89HDF\r\n\x1a\n"
UNITS = ("unit", "units", "unit_string", "dimension")
"""Names of an attribute or a field that holds the unit."""
SAMPLES = ("values", "value", "data", "y", "samples")
"""Fields of a struct whose unit the field `unit` is."""
_MISSING = ("_FillValue", "missing_value")
"""Attributes of values that stand for missing samples (CF conventions); alternating quantities pass 0."""
_MOST = 10_000  # datasets
_SHORT = 64  # numbers of a dataset that holds a text or a factor
_ADVICE = "store the arrays as datasets time, u1, i1 ..., with an attribute unit"


def load(path: Path, given: ChannelMap) -> Recording:
    """Numeric datasets of one or two dimensions, and fields of tables. Raises InputError.

    `scale_factor` and `add_offset` (CF conventions) are applied; rates and steps may be datasets or attributes.
    """
    require("HDF5 files", ["h5py"], "files")
    import h5py

    contents = Contents()
    try:
        with h5py.File(path, "r") as file:
            is_matlab = _is_matlab(path)
            datasets, groups = _datasets(path, file)
            check_size(path, sum(8 * one.size for _, one in datasets))
            _collect_texts(contents, datasets)
            for group, one in (("", file), *groups):
                _numbers_of(contents, f"{group}/", one.attrs)
            units = {_group(name): _texts(one) for name, one in datasets if _last(name) in UNITS}
            factors = _factors(datasets, groups)
            for name, dataset in datasets:
                folder = _group(name) if _last(name) in SAMPLES else ""
                _add(contents, path, name, dataset, units.get(folder or name, ""), factors.get(folder, ""))
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes HDF5 raise
        raise damaged(path, "HDF5 file", error) from None
    return recording_of(path, "MATLAB 7.3" if is_matlab else "HDF5", contents, given, _ADVICE)


def _is_matlab(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(10) == b"MATLAB 7.3"


def _datasets(path: Path, file: Any) -> tuple[list[tuple[str, Any]], list[tuple[str, Any]]]:
    """Datasets and groups with their names; links out of the file are not followed."""
    import h5py

    found: list[tuple[str, Any]] = []
    groups: list[tuple[str, Any]] = []

    def visit(name: str, one: Any) -> None:
        if len(found) > _MOST:
            raise InputError(path, f"holds more than {_MOST} datasets; expected a recording")
        if isinstance(one, h5py.Dataset) and not name.startswith("#"):
            if one.external or one.is_virtual:
                raise InputError(path, f"{name} lies in another file; expected all samples in this one")
            found.append((name, one))
        elif isinstance(one, h5py.Group):
            groups.append((name, one))

    file.visititems(visit)
    return found, groups


def _collect_texts(contents: Contents, datasets: list[tuple[str, Any]]) -> None:
    for name, dataset in datasets:
        if dataset.dtype.kind in "OS" and dataset.ndim == 1 and 1 < dataset.size <= 64:
            texts = [one.decode(errors="replace") if isinstance(one, bytes) else "" for one in dataset[...]]
            if all(texts):
                contents.names[name] = texts


def _group(name: str) -> str:
    return name.rpartition("/")[0]


def _factors(datasets: list[tuple[str, Any]], groups: list[tuple[str, Any]]) -> dict[str, str]:
    """What a group says of a factor of the samples in it, by its name: in a dataset beside them, or in an attribute."""
    found = {}
    for name, one in datasets:
        if _group(name) and 0 < (one.size or 0) <= _SHORT and scales(name.rpartition("/")[2], one[...]):
            found[_group(name)] = f"a field {name.rpartition('/')[2]}"
    for name, one in groups:
        for key in one.attrs:
            if scales(key, one.attrs[key]):
                found[name] = f"an attribute {key}"
    return found


def _last(name: str) -> str:
    return name.rpartition("/")[2].lower()


def _texts(dataset: Any) -> str:
    """The text in a dataset: a string, or characters of MATLAB; empty for anything else."""
    if dataset.size > _SHORT:
        return ""
    value = dataset[...]
    if dataset.attrs.get("MATLAB_class", b"") == b"char" and value.dtype.kind == "u":
        return "".join(map(chr, value.reshape(-1).tolist())).strip()
    one = value.reshape(-1)[0] if value.dtype.kind in "OS" and value.size == 1 else b""
    return one.decode(errors="replace").strip() if isinstance(one, bytes) else ""


def _add(contents: Contents, path: Path, name: str, dataset: Any, unit: str, factor: str) -> None:
    """One dataset; `unit` and `factor` as the group around it says."""
    if dataset.dtype.names:
        for column in dataset.dtype.names:
            kind = dataset.dtype[column]
            if dataset.ndim == 1 and kind.kind in "iuf" and kind.shape == ():
                contents.add(f"{name}/{column}" if "/" in name else column, dataset.shape, _reader(path, name, column))
        return
    if dataset.dtype.kind not in "iuf" or dataset.attrs.get("MATLAB_class", b"") == b"char":
        return
    number = scalar(dataset[...]) if dataset.size == 1 else None
    if number is not None:
        contents.numbers[name] = number
        return
    _numbers_of(contents, f"{name}/", dataset.attrs)
    scale, offset = (scalar(dataset.attrs.get(key, [])) for key in ("scale_factor", "add_offset"))
    for key in dataset.attrs:
        if key not in ("scale_factor", "add_offset") and scales(key, dataset.attrs[key]):
            factor = factor or f"an attribute {key}"
    if factor:
        contents.notes.append(not_applied(name, factor))
    contents.add(
        name, dataset.shape, _reader(path, name), _unit(dataset.attrs) or unit,
        scale=1.0 if scale is None else scale, offset=offset or 0.0, unapplied=bool(factor),
    )  # fmt: skip


def _reader(path: Path, name: str, column: str | None = None) -> Any:
    """Reads a dataset, or one field of a table."""

    def read() -> Any:
        import h5py

        with h5py.File(path, "r") as file:
            dataset = file[name]
            values = np.asarray(dataset[...] if column is None else dataset[column])
            marks = {key: scalar(dataset.attrs[key]) for key in _MISSING if key in dataset.attrs and column is None}
            for key, mark in marks.items():
                missing = np.flatnonzero(values == mark) if mark else np.empty(0, dtype=np.intp)
                if missing.size:
                    raise InputError(path, f"{name}: sample {missing[0] + 1} is marked as missing ({key})")
            return values

    return read


def _unit(attributes: Any) -> str:
    for key in attributes:
        if key.lower() in UNITS:
            value = attributes[key]
            text = value.decode(errors="replace") if isinstance(value, bytes) else value
            if isinstance(text, str):
                return text
    return ""


def _numbers_of(contents: Contents, prefix: str, attributes: Any) -> None:
    """Scalars among the attributes, which may be a rate or a step."""
    for key in attributes:
        number = scalar(attributes[key]) if np.asarray(attributes[key]).dtype.kind in "iufb" else None
        if number is not None:
            contents.numbers.setdefault(f"{prefix}{key}", number)
