"""The address space: Objects / acqd / DEVICE / CHANNEL / quantity, made as rows arrive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from asyncua import Server, ua

from acqd.integrations.opcua.quality import STALE
from acqd.integrations.opcua.values import Values, of_event, of_quality, of_row
from acqd.integrations.quality import EVENT, LIST_QUANTITIES, QUALITY, level
from acqd.integrations.quantities import ROW, Quantity
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.row import PowerRow

NAMESPACE = "urn:acqd:rows"
Path = tuple[str, ...]
"""Names of folders below `acqd`: DEVICE, CHANNEL, perhaps "quality", "150-180"; or DEVICE, "events", KIND."""
_UNITS = "http://www.opcfoundation.org/UA/units/un/cefact"
_MOST_GROUPS = 4_000
"""What a stranger on the broker may make of the server's memory."""


@dataclass(slots=True)
class _Group:
    """Variables that are written together."""

    nodes: dict[str, ua.NodeId]
    filetime: int = 0
    values: Values = field(default_factory=dict)


class Space:
    """Variables of all channels; node identifiers are strings like `cell.total.P`."""

    def __init__(self, server: Server, index: int) -> None:
        """`index`: of the namespace."""
        self._server, self._index = server, index
        self._groups: dict[Path, _Group] = {}
        self._folders: dict[Path, Any] = {}

    async def write(self, message: PowerRow | QualityRow | PowerEvent) -> None:
        """The values of a row or an event with their quality and time. Older ones (a backlog) are left out."""
        path = path_of(message)
        if path not in self._groups and len(self._groups) >= _MOST_GROUPS:
            return
        quantities: tuple[Quantity, ...]
        if isinstance(message, PowerRow):
            quantities, values = ROW, of_row(message)
        elif isinstance(message, QualityRow):
            quantities, values = (*QUALITY, *LIST_QUANTITIES), of_quality(message)
        else:
            quantities, values = EVENT, of_event(message)
        group = self._groups.get(path) or await self._made(path, quantities, values)
        ended = isinstance(message, PowerEvent) and message.duration is not None
        if message.filetime < group.filetime or (message.filetime == group.filetime and not ended):
            return
        group.filetime, group.values = message.filetime, values
        for name, value in values.items():
            await self._server.write_attribute_value(group.nodes[name], value)

    async def spoil(self, path: Path) -> None:
        """The last values are bad from now on: their rows have stopped."""
        known = self._groups[path]
        for name, value in known.values.items():
            stale = ua.DataValue(
                value.Value, STALE, SourceTimestamp=value.SourceTimestamp, ServerTimestamp=datetime.now(UTC)
            )
            await self._server.write_attribute_value(known.nodes[name], stale)

    async def _folder(self, path: Path) -> Any:
        if path not in self._folders:
            above = await self._folder(path[:-1]) if path else self._server.nodes.objects
            name = path[-1] if path else "acqd"
            self._folders[path] = await above.add_folder(self._id(".".join(path) or name), self._name(name))
        return self._folders[path]

    async def _made(self, path: Path, quantities: Sequence[Quantity], values: Values) -> _Group:
        folder, place = await self._folder(path), ".".join(path)
        nodes = {each.key: await self._variable(folder, f"{place}.{each.key}", each) for each in quantities}
        for name in values.keys() - nodes.keys():
            node = await folder.add_variable(self._id(f"{place}.{name}"), self._name(name), values[name].Value)
            nodes[name] = node.nodeid
        made = self._groups[path] = _Group(nodes)
        return made

    async def _variable(self, folder: Any, place: str, quantity: Quantity) -> ua.NodeId:
        """A variable with its unit, of the type AnalogUnitType."""
        several = quantity in LIST_QUANTITIES
        first = ua.Variant([] if several else 0.0, ua.VariantType.Double, is_array=several)
        node = await folder.add_variable(self._id(place), self._name(quantity.key), first)
        await node.delete_reference(
            ua.ObjectIds.BaseDataVariableType, ua.ObjectIds.HasTypeDefinition, forward=True, bidirectional=False
        )
        await node.add_reference(
            ua.NodeId(ua.ObjectIds.AnalogUnitType), ua.ObjectIds.HasTypeDefinition, forward=True, bidirectional=False
        )
        await node.write_attribute(
            ua.AttributeIds.Description, ua.DataValue(ua.Variant(ua.LocalizedText(quantity.title)))
        )
        await node.add_property(
            self._id(f"{place}.EngineeringUnits"), ua.QualifiedName("EngineeringUnits", 0), unit(quantity)
        )
        return node.nodeid

    def _id(self, text: str) -> ua.NodeId:
        return ua.NodeId(text, self._index)

    def _name(self, text: str) -> ua.QualifiedName:
        return ua.QualifiedName(text, self._index)


def path_of(message: PowerRow | QualityRow | PowerEvent) -> Path:
    """Where the values of a message are."""
    if isinstance(message, PowerEvent):
        return message.device, "events", message.kind
    if isinstance(message, QualityRow):
        return message.device, message.channel, "quality", level(message.aggregation)
    return message.device, message.channel


def unit(quantity: Quantity) -> ua.EUInformation:
    """Of a quantity: the number is that of the characters of its common code (OPC 10000-8, 5.6.4.3), or -1."""
    number = int.from_bytes(quantity.unece.encode(), "big") if quantity.unece else -1
    return ua.EUInformation(_UNITS, number, ua.LocalizedText(quantity.unit or "1"), ua.LocalizedText(quantity.title))
