"""A mistake in acqd.toml as a sentence that names the key, what was expected, and the key that was perhaps meant."""

from __future__ import annotations

import difflib
from typing import Any, get_args

from pydantic import BaseModel

from acqd.daemon.config import Config
from acqd.daemon.correction_section import CorrectionSection
from acqd.daemon.source_sections import SECTIONS
from acqd.errors import in_our_words
from acqd.section import Section


def complaint(fault: Any) -> str:
    """One pydantic error as a sentence that names the key."""
    place, kind = list(fault["loc"]), ""
    if place[:1] == ["sources"] and len(place) > 1:
        inner = complaint({**fault, "loc": place[2:]})
        return f"source {place[1] + 1}: {inner}"
    if not place:
        return in_our_words(str(fault["msg"]))
    if place[0] == "source" and len(place) > 1 and place[1] in _KINDS:  # pydantic names the union's member there
        kind = str(place.pop(1))
    key = ".".join(str(part) for part in place)
    if fault["type"] == "missing":
        return f"{key} is missing" + (f' (kind = "{kind}")' if kind else "")
    if fault["type"] == "union_tag_invalid":
        return f"source.kind: {fault['input'].get('kind')!r} is unknown, expected one of {', '.join(_KINDS)}"
    if fault["type"] != "extra_forbidden":
        pattern = fault.get("ctx", {}).get("pattern", "") if fault["type"] == "string_pattern_mismatch" else ""
        expected = f"expected {PATTERNS[pattern]}" if pattern in PATTERNS else in_our_words(fault["msg"])
        return f"{key}: {expected}{_got(key, fault['input'])}"
    foreign = [name for name, section in _KINDS.items() if key.removeprefix("source.") in section.model_fields]
    if kind and foreign:
        return f"{key} belongs to kind {' or '.join(foreign)}, here kind is {kind}; delete it"
    known = known_keys() if "correction." not in key else _CORRECTIONS
    if isinstance(fault["input"], dict) and len(place) == 1:
        known = [name for name in Config.model_fields if name != "sources"]
    near = difflib.get_close_matches(key, known, n=1)
    same_end = [name for name in known if name.rpartition(".")[2] == key.rpartition(".")[2]]
    if not (same_end or near):
        return f"unknown key {key}; acqd config init writes a file with every key"
    return f"unknown key {key}; did you mean {' or '.join(same_end or near)}?"


def _got(key: str, value: Any) -> str:
    """What the file says instead, unless that may be a secret: a password, or anything in the place of a section."""
    name = key.rpartition(".")[2]
    plain = isinstance(value, (str, int, float)) and "." in key and name not in SECRET
    shown = str(value).lower() if isinstance(value, bool) else f"{value!r:.60}"  # as TOML writes it
    return f" (got {shown})" if plain or (key in ("device", "state_dir") and isinstance(value, str)) else ""


_KINDS: dict[str, type[Section]] = {
    get_args(section.model_fields["kind"].annotation)[0]: section for section in SECTIONS
}


_CORRECTIONS = [f"source.correction.{name}" for name in CorrectionSection.model_fields]
SECRET = {"password", "password_file", "database", "username", "token", "url", "webhooks", "smtp_password"}
"""Keys whose values are not shown."""
PATTERNS = {
    r"^\d{1,3}(\.\d{1,3}){5}$": "six numbers like 5.12.34.56.1.1",
    r"^([0-9A-Fa-f]{4}:[0-9A-Fa-f]{2})?$": "index:subindex in hexadecimal like F800:01, or nothing",
    r"^[A-Za-z0-9_-]+$": "letters, digits, - and _",
    r"^[A-Za-z0-9_.-]+$": "letters, digits, . - and _",
    r"^[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*$": "a topic of letters, digits, - and _",
    r"^[^/+#\s]+(/[^/+#\s]+)*$": "a topic without blanks, + and #",
    r"^[^/+#\s]{1,64}$": "1 to 64 letters without blanks, / + and #",
    r"^[^/+#]*$": "a name without / + and #",
    r"^https?://": "an address that begins with http:// or https://",
    r"^[^@\s]+@[^@\s]+$": "a mail address like ada@example.org",
}
"""Patterns of keys in words."""


def known_keys() -> list[str]:
    """Every key of the file, with its section; `source` has the keys of all kinds."""
    keys = []
    for name, info in Config.model_fields.items():
        section = info.annotation
        if name == "sources":
            continue  # written as [[source]]
        if name == "source":
            keys += sorted({f"source.{key}" for kind in SECTIONS for key in kind.model_fields})
        elif isinstance(section, type) and issubclass(section, BaseModel):
            keys += [f"{name}.{key}" for key in section.model_fields]
        else:
            keys.append(name)
    return keys
