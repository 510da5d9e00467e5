"""Configuration files of earlier versions: what has no effect any more is left out, and what has moved is found."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

from acqd.daemon.source_sections import SECTIONS
from acqd.errors import InputError


def without_effect(data: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The file's content without keys of other kinds of source that have their default, and a note for each.

    The first version wrote the keys of all kinds into one block. A key of another kind with another value stays: a
    person meant something by it, and is told.
    """
    source = data.get("source")
    if not isinstance(source, dict):
        return data, []
    kind = source.get("kind", "simulated")
    kinds = {get_args(section.model_fields["kind"].annotation)[0]: section for section in SECTIONS}
    if not isinstance(kind, str) or kind not in kinds:
        return data, []
    notes = {}
    for key, value in source.items():
        if key in kinds[kind].model_fields:
            continue
        fields = [section.model_fields[key] for section in kinds.values() if key in section.model_fields]
        if any(type(field.default) is type(value) and field.default == value for field in fields):
            notes[key] = f"source.{key} is a default of another kind than {kind} and has no effect; delete it"
    kept = {key: value for key, value in source.items() if key not in notes}
    return {**data, "source": kept}, list(notes.values())


def with_tariff(data: dict[str, Any], path: Path) -> tuple[dict[str, Any], list[str]]:
    """The file's content with `web.tariff`, of the page only in earlier versions, as `energy.tariff`; and a note.

    Raises InputError where the two name different files.
    """
    web, energy = data.get("web"), data.get("energy", {})
    if not isinstance(web, dict) or "tariff" not in web or not isinstance(energy, dict):
        return data, []
    if energy.get("tariff", web["tariff"]) != web["tariff"]:
        raise InputError(path, "web.tariff and energy.tariff name different files; delete web.tariff")
    kept = {key: value for key, value in web.items() if key != "tariff"}
    note = "web.tariff holds for all costs; acqd config upgrade moves it to [energy]"
    return {**data, "web": kept, "energy": {"tariff": place_of_tariff(web["tariff"], path), **energy}}, [note]


def place_of_tariff(tariff: Any, path: Path) -> Any:
    """`web.tariff` for `energy.tariff`: relative to the file, where it was relative to the working folder."""
    if not isinstance(tariff, str) or Path(tariff).is_absolute() or (path.parent / tariff).exists():
        return tariff
    found = Path(tariff).absolute()
    return str(found) if found.exists() else tariff
