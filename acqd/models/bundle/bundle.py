"""A trained model as a folder: metadata in bundle.json, arrays in weights.safetensors."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import orjson
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from acqd.atomic import complete_folder, require_writable
from acqd.errors import InputError, UserError

FORMAT = 1
REFERENCE = "reference.safetensors"
REFERENCE_HASH = "reference_sha256"
"""Key of bundle.json; null for a bundle without reference recordings, absent in bundles of earlier versions."""
Arrays: TypeAlias = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Bundle:
    """Contents of a bundle, read from disk or to be written."""

    metadata: dict[str, Any]
    """kind, name, robot, axes, step_s, units, architecture, normalisation, envelope, metrics, provenance."""
    arrays: Arrays
    reference: Arrays | None = None
    """Reference recordings (see `bundle.reference`) to be written; None: none. They are not read with a bundle."""


def require_free(path: Path) -> None:
    """Raise UserError unless a bundle may be written to `path`: nothing there, an empty folder or a bundle."""
    require_writable(path)
    if path.exists() and not is_bundle(path) and not (path.is_dir() and not any(path.iterdir())):
        raise UserError(f"{path} exists and is not a bundle: it would be overwritten; choose another --out")


def require_made_again(path: Path, same: Callable[[dict[str, Any]], bool]) -> None:
    """Raise UserError unless a bundle may be written to `path`, and one that is there is the `same` made before."""
    require_free(path)
    if not is_bundle(path):
        return
    try:
        earlier = load_metadata(path)
    except InputError:  # damaged, or of another version: made again is what helps
        return
    if not same(earlier):
        raise UserError(
            f"{path} holds another model ({earlier.get('name')}): it would be lost; choose another --out, or remove it"
        )


def save_bundle(path: Path, bundle: Bundle) -> None:
    """Write a bundle completely or not at all; an existing bundle is replaced. Raises UserError, OperationError."""
    require_free(path)
    weights = _packed(bundle.arrays)
    reference = None if bundle.reference is None else _packed(bundle.reference)
    hashes = {
        "weights_sha256": hashlib.sha256(weights).hexdigest(),
        REFERENCE_HASH: None if reference is None else hashlib.sha256(reference).hexdigest(),
    }
    metadata = {"format": FORMAT, **bundle.metadata, **hashes}
    with complete_folder(path) as folder:
        (folder / "bundle.json").write_bytes(
            orjson.dumps(metadata, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
        )
        (folder / "weights.safetensors").write_bytes(weights)
        if reference is not None:
            (folder / REFERENCE).write_bytes(reference)


def _packed(arrays: Arrays) -> bytes:
    """Arrays as the content of a safetensors file."""
    return save({name: np.ascontiguousarray(array) for name, array in arrays.items()})


def load_bundle(path: Path) -> Bundle:
    """Read a bundle without its reference recordings. Raises InputError."""
    metadata = load_metadata(path)
    file = path / "weights.safetensors"
    try:
        weights = file.read_bytes()
        arrays = load(weights)
    except (OSError, SafetensorError) as error:
        raise InputError(file, f"cannot be read ({error}); copy the bundle again") from None
    # bundles of earlier versions have no hash
    if metadata.get("weights_sha256") not in (None, hashlib.sha256(weights).hexdigest()):
        raise InputError(file, "does not match the hash in bundle.json; copy the bundle again")
    return Bundle(metadata, arrays)


def load_metadata(path: Path) -> dict[str, Any]:
    """Read the bundle.json of a bundle. Raises InputError."""
    file = path / "bundle.json"
    try:
        metadata = orjson.loads(file.read_bytes())
    except (FileNotFoundError, NotADirectoryError):
        what = "is not a bundle: it has no bundle.json" if path.exists() else "no such folder"
        raise InputError(path, f"{what}; acqd train writes bundles") from None
    except OSError as error:
        raise InputError(file, f"cannot be read ({error.strerror}); may this user read it?") from None
    except orjson.JSONDecodeError as error:
        raise InputError(file, f"is damaged ({error}); train the model again, or copy the bundle again") from None
    if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
        raise InputError(
            file, f"has another format than {FORMAT}: it is from another version of acqd; use that, or train again"
        )
    return metadata


def fingerprint(path: Path) -> str:
    """SHA-256 of bundle.json and weights.safetensors: it changes with every fit and every added effect."""
    digest = hashlib.sha256()
    for name in ("bundle.json", "weights.safetensors"):
        digest.update((path / name).read_bytes())
    return digest.hexdigest()


def is_bundle(path: Path) -> bool:
    """Whether the folder `path` contains a bundle.json."""
    return (path / "bundle.json").is_file()
