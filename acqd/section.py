"""What the tables of all TOML files are made of: the strict base model, and types that TOML writes another way."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, field_validator

ARRAY = Field(strict=False)
"""Of a field that is a tuple here: TOML has arrays. The array's items stay strict."""
KEY = Field(strict=False)
"""Of a key that is a number here: TOML's keys are text."""


def _usable(path: Path) -> Path:
    """The path with the home folder in the place of `~`. Raises ValueError for what no file can be called."""
    if "\0" in str(path):
        raise ValueError("holds a NUL character, and no path does")
    try:
        return path.expanduser()
    except RuntimeError:
        raise ValueError("names the home of an unknown user; write the whole path") from None


def _named(value: Any) -> Any:
    """The value, unless it is an empty text, which would mean the folder of the moment. Raises ValueError."""
    if value == "":
        raise ValueError("expected a path; leave the key out for none")
    return value


_LONGEST = 65_535
"""Bytes of a text in MQTT (OASIS standard 5.0, section 1.5.4): of a name, a password, a topic."""
FileName = Annotated[Path, Field(strict=False), BeforeValidator(_named), AfterValidator(_usable)]
"""A path, which TOML writes as text."""


class Section(BaseModel):
    """A table of a TOML file. Unknown keys are mistakes, and so are values of another type.

    A number in quotes, or `true` for a number, is more likely a slip than a value; only an integer may stand for a
    number with a fraction.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True)
    must_exist: ClassVar[tuple[str, ...]] = ()
    """Keys that name a file or folder, which has to be there before a service starts."""
    in_working_folder: ClassVar[tuple[str, ...]] = ()
    """Keys that name a file of a service: a relative name is one in the folder in which the service works."""

    @field_validator("*", mode="after")
    @classmethod
    def _sendable(cls, value: Any) -> Any:
        """No text of a configuration holds what neither a broker nor a path takes: it would be tried for ever."""
        if isinstance(value, str):
            if "\0" in value:
                raise ValueError("holds a NUL character")
            if len(value.encode(errors="replace")) > _LONGEST:
                raise ValueError(f"is longer than {_LONGEST} bytes")
        return value
