"""What is installed: daemons and sinks with host, version, devices and sources, as they have told the broker."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from acqd.numerals import whole_number
from acqd.plant.heard import Heard, Status


@dataclass(frozen=True, slots=True)
class Installed:
    """A daemon or a sink."""

    kind: str
    name: str
    online: bool
    host: str
    """"" where an earlier version does not say, or an offline one was never heard."""
    version: str
    since: str
    """Start of the process, RFC 3339."""
    devices: tuple[str, ...]
    source: str
    remarks: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """For programs."""
        return {name: getattr(self, name) for name in self.__slots__}


HEADER = ("kind", "name", "state", "host", "version", "running since", "devices", "source", "remarks")


def inventory(heard: Heard) -> list[Installed]:
    """Everything that has ever announced itself on the broker, by name."""
    found = [
        *(_daemon(name, status, heard.faults.get(name, {})) for name, status in sorted(heard.daemons.items())),
        *(_sink(name, status) for name, status in sorted(heard.sinks.items())),
    ]
    return _marked([each if each.online else _as_remembered(each, heard) for each in found])


def _as_remembered(one: Installed, heard: Heard) -> Installed:
    """An offline process with what it said when it ran, where this computer has heard that."""
    last = heard.earlier.get((f"{one.kind}s", one.name))
    if last is None:
        return one
    known = _daemon(one.name, last, {}) if one.kind == "daemon" else _sink(one.name, last)
    return replace(known, online=False, since="", remarks=("as heard before it went offline",))


def cells(one: Installed) -> tuple[str, ...]:
    """A row of the table."""
    return (
        one.kind, one.name, "online" if one.online else "offline", one.host or "-", one.version or "-",
        one.since[:16].replace("T", " ") or "-", ", ".join(one.devices), one.source, "; ".join(one.remarks),
    )  # fmt: skip


def _daemon(name: str, status: Status | None, faults: dict[str, str]) -> Installed:
    if status is None:
        return Installed("daemon", name, False, "", "", "", (), "", ())
    given = status.get("name")
    of = given if isinstance(given, dict) else {}
    remarks = [text for kind, text in faults.items() if kind != "offline"]
    if status.get("realtime_refused"):
        remarks.append("without real-time priority")
    if status.get("rival"):
        remarks.append("another daemon has its name")
    return Installed(
        "daemon", name, True, str(of.get("host", "")), str(status.get("version", "")), str(status.get("started", "")),
        tuple(_devices(name, status)), str(status.get("source", "")), tuple(remarks),
    )  # fmt: skip


def _devices(name: str, status: Status) -> Iterator[str]:
    """Of boxes and of meters; else the daemon's own name."""
    tables = [status.get(key) for key in ("boxes", "meters")]
    names: list[str] = []
    for table in tables:
        for each, content in table.items() if isinstance(table, dict) else ():
            meters = content.get("meters") if isinstance(content, dict) else None
            names += list(map(str, meters)) if isinstance(meters, dict) and meters else [str(each)]
    yield from names or [name]


def _sink(name: str, status: Status | None) -> Installed:
    if status is None:
        return Installed("sink", name, False, "", "", "", (), "", ())
    host, version, started = (str(status.get(key, "")) for key in ("host", "version", "started"))
    return Installed("sink", name, True, host, version, started, (), "", ())


def _marked(found: list[Installed]) -> list[Installed]:
    """With a remark on what does not run the newest version that is running."""
    newest = max((_numbers(one.version) for one in found if one.version), default=())
    shown = next((one.version for one in found if one.version and _numbers(one.version) == newest), "")
    return [
        replace(one, remarks=(*one.remarks, f"older than {shown}"))
        if one.version and _numbers(one.version) < newest else one
        for one in found
    ]  # fmt: skip


def _numbers(version: str) -> tuple[int, ...]:
    parts = (whole_number(part) for part in version.replace("-", ".").split("."))
    return tuple(-1 if part is None else part for part in parts)
