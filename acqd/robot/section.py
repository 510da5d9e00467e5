"""TOML files as validated sections: unknown keys, wrong types and missing keys are named by file and key."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from acqd import section
from acqd.errors import InputError, in_our_words, place_in_file
from acqd.toml_file import tables_of

Model = TypeVar("Model", bound=BaseModel)


class Section(section.Section):
    """A table of a TOML file that does not change once it is read."""

    model_config = ConfigDict(frozen=True, populate_by_name=True)


def read_toml(path: Path, model: type[Model]) -> Model:
    """A validated TOML file. Raises InputError that names file and key."""
    try:
        return model.model_validate(read_toml_table(path))
    except ValidationError as error:
        raise InputError(path, "; ".join(complaint(fault) for fault in error.errors())) from None


def read_toml_table(path: Path) -> dict[str, Any]:
    """The raw content of a TOML file. Raises InputError."""
    try:
        return tables_of(path)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None


def complaint(fault: object) -> str:
    """One pydantic error as `key: what is wrong (got ...)`."""
    assert isinstance(fault, dict)
    key = place_in_file(fault["loc"]) or "the file"
    if fault["type"] == "extra_forbidden":
        return f"{key}: there is no such key; is it misspelt, or in the wrong table?"
    if fault["type"] == "missing":
        return f"{key} is missing"
    message = in_our_words(fault["msg"])
    if isinstance(fault["input"], dict | BaseModel):  # the message names the key; the rest of the table says nothing
        return f"{key}: {message}"
    return f"{key}: {message} (got {fault['input']!r:.60})"
