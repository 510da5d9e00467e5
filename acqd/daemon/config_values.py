"""The values of a configuration by their keys, to be compared."""

from __future__ import annotations

from typing import Any

from acqd.daemon.config import Config
from acqd.daemon.config_complaint import SECRET

_NO_VALUE: tuple[object, ...] = (None, "", [], {})


def values_of(config: Config) -> dict[str, Any]:
    """Values by `section.key`; what lies deeper, and several sources, are one value."""
    found: dict[str, Any] = {}
    for name, value in config.model_dump(mode="json").items():
        if name == "source":  # all keys of a kind together, so that kinds can be compared
            found |= {"source.kind": value["kind"]} | {f"source.{key}": one for key, one in value.items()}
        elif isinstance(value, dict):
            found |= {f"{name}.{key}": one for key, one in value.items()}
        else:
            found[name] = value
    if several := found.pop("sources"):
        found = {key: value for key, value in found.items() if not key.startswith("source.")}
        found |= {f"source {number}": one for number, one in enumerate(several, 1)}
    return found


def differences(one: Config, other: Config) -> list[tuple[str, Any, Any]]:
    """Keys with another value in the two, and both values (None where a source has no such key)."""
    first, second = values_of(one), values_of(other)
    keys = [*first, *(key for key in second if key not in first)]
    return [(key, first.get(key), second.get(key)) for key in keys if first.get(key) != second.get(key)]


def shown(key: str, value: Any) -> str:
    """A value as a person reads it; dots where it may be a secret."""
    if value in _NO_VALUE:
        return "-" if value is None else repr(value)
    if isinstance(value, dict):
        return ", ".join(f"{name} = {shown(name, one)}" for name, one in value.items() if one is not None)
    if key.rpartition(".")[2] in SECRET - {"username", "password_file"}:
        return "..."
    return str(value).lower() if isinstance(value, bool) else repr(value) if isinstance(value, str) else f"{value}"
