"""`acqd config upgrade`: an earlier acqd.toml rewritten, with its comments; backups stay next to it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Table

from acqd.daemon.config_file import parsed_config, read_toml
from acqd.daemon.config_values import differences
from acqd.daemon.earlier_files import place_of_tariff, without_effect
from acqd.errors import InputError
from acqd.installation.earlier_layout import merged, missing_users


@dataclass(frozen=True, slots=True)
class Upgrade:
    """How a file would be rewritten."""

    path: Path
    before: str
    after: str
    notes: tuple[str, ...]
    """What changes, in words."""
    merged: tuple[Path, ...]
    """Files of services that become links to this one."""

    @property
    def needed(self) -> bool:
        """Whether anything changes."""
        return self.before != self.after or bool(self.merged)


def planned(path: Path) -> Upgrade:
    """The file in the form of this version. Raises InputError for a file that cannot be read, merged or rewritten."""
    try:
        return _planned(path)
    except (TOMLKitError, AttributeError, KeyError, TypeError) as error:  # TOML that the library cannot edit in place
        raise InputError(path, f"is written in a way that cannot be edited here ({error}); edit it by hand") from None


def _planned(path: Path) -> Upgrade:
    data = read_toml(path)
    config = parsed_config(data, path)
    before = path.read_text(encoding="utf-8-sig")
    document = tomlkit.parse(before)
    kept, dropped = without_effect(data)
    if isinstance(source := data.get("source"), dict):
        for key in source.keys() - kept["source"].keys():
            del document["source"][key]
    notes = [note.replace("has no effect; delete it", "had no effect") for note in dropped]
    if "queue" in data.get("mqtt", {}):
        del document["mqtt"]["queue"]
        notes.append("mqtt.queue had no effect: rows wait in the spool")
    together = merged(path, config)
    values = together.values | missing_users(config, path.parent)
    if "tariff" in data.get("web", {}):
        moved = data.get("energy", {}).get("tariff") or place_of_tariff(data["web"]["tariff"], path)
        values |= {"web.tariff": None, "energy.tariff": moved}
        notes.append("web.tariff is now energy.tariff: of the page and of everything else that shows a cost")
    _set(document, values)
    notes += together.notes
    for key, user in values.items():
        if key.startswith("mqtt.") and isinstance(user, dict):
            notes.append(f"{key}: the service logs in as {user.get('username', 'the daemon')}")
    after = tomlkit.dumps(document)
    rewritten = parsed_config(dict(tomlkit.parse(after).unwrap()), path)
    if other := {key for key, _, _ in differences(config, rewritten)} - values.keys() - {"mqtt.queue"}:
        raise InputError(path, f"cannot be rewritten without changing {', '.join(sorted(other))}; edit it by hand")
    return Upgrade(path, before, after, tuple(notes), together.files)


def carry_out(upgrade: Upgrade) -> list[Path]:
    """Write the file, and links in the place of merged ones; returns the backups. Raises InputError.

    The files change one by one, complete or not at all. A link keeps the units of an earlier version alive until
    `acqd service update` writes them again.
    """
    if not upgrade.needed:
        return []
    stamp = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    backups = {path: path.with_name(f"{path.name}.{stamp}") for path in (upgrade.path, *upgrade.merged)}
    new = upgrade.path.with_name(f".{upgrade.path.name}.new")
    try:
        for path, backup in backups.items():
            shutil.copy2(path, backup)
            _same_owner(path, backup)
        shutil.copy2(upgrade.path, new)  # the mode
        _same_owner(upgrade.path, new)
        with new.open("w", encoding="utf-8") as file:
            file.write(upgrade.after)
            file.flush()
            os.fsync(file.fileno())
        new.replace(upgrade.path)
        for path in upgrade.merged:
            link = path.with_name(f".{path.name}.new")
            link.symlink_to(upgrade.path.name)
            link.replace(path)
    except OSError as error:
        with suppress(OSError):
            new.unlink()
        raise InputError(upgrade.path, f"cannot be upgraded ({error.strerror}); who owns it may, with sudo") from None
    return list(backups.values())


def _same_owner(path: Path, other: Path) -> None:
    status = path.stat()
    if (status.st_uid, status.st_gid) != (os.geteuid(), os.getegid()):
        os.chown(other, status.st_uid, status.st_gid)


def _set(document: tomlkit.TOMLDocument, values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        section, _, name = key.rpartition(".")
        if section and section not in document:
            if value is None:
                continue
            document.add(section, tomlkit.table())
        table = document[section] if section else document
        if value is None:
            table.pop(name, None)
        elif name in table:
            table[name] = value
        else:
            _add(table, name, value)


def _add(table: Any, name: str, value: Any) -> None:
    """A key behind the last one of a table, before the blank line and the comments of what follows."""
    item = tomlkit.inline_table() if isinstance(value, dict) else value
    if isinstance(value, dict):
        item.update(value)
    last = list(table.keys())[-1:] if isinstance(table, Table) else []
    if last and not isinstance(table[last[0]], Table):
        table.value._insert_after(last[0], name, tomlkit.item(item))
    else:
        table[name] = item
