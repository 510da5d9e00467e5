"""The address space: Objects / acqd / DEVICE / CHANNEL / quantity, made as rows arrive."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from asyncua import Server, ua

from acqd.integrations.opcua.quality import ABSENT, GOOD, STALE, status_of
from acqd.integrations.quantities import ROW, Quantity
from acqd.telemetry.row import PowerRow

NAMESPACE = "urn:acqd:rows"
_UNITS = "http://www.opcfoundation.org/UA/units/un/cefact"
_MOST_CHANNELS = 4_000
"""What a stranger on the broker may make of the server's memory."""


@dataclass(slots=True)
class _Channel:
    nodes: dict[str, ua.NodeId]
    filetime: int = 0
    values: dict[str, ua.DataValue] = field(default_factory=dict)


class Space:
    """Variables of all channels; node identifiers are strings like `cell.total.P`."""

    def __init__(self, server: Server, index: int) -> None:
        """`index`: of the namespace."""
        self._server, self._index = server, index
        self._channels: dict[tuple[str, str], _Channel] = {}
        self._root: Any = None
        self._devices: dict[str, Any] = {}

    async def write(self, row: PowerRow) -> None:
        """The values of a row with their quality and the time of its window. Older rows (a backlog) are left out."""
        key = (row.device, row.channel)
        if key not in self._channels and len(self._channels) >= _MOST_CHANNELS:
            return
        channel = self._channels.get(key) or await self._made(*key)
        if row.filetime <= channel.filetime:
            return
        channel.filetime = row.filetime
        channel.values = _values(row)
        for name, value in channel.values.items():
            await self._server.write_attribute_value(channel.nodes[name], value)

    async def spoil(self, device: str, channel: str) -> None:
        """The last values are bad from now on: their rows have stopped."""
        known = self._channels[device, channel]
        for name, value in known.values.items():
            stale = ua.DataValue(
                value.Value, STALE, SourceTimestamp=value.SourceTimestamp, ServerTimestamp=datetime.now(UTC)
            )
            await self._server.write_attribute_value(known.nodes[name], stale)

    async def _made(self, device: str, channel: str) -> _Channel:
        if self._root is None:
            self._root = await self._server.nodes.objects.add_folder(self._id("acqd"), self._name("acqd"))
        if device not in self._devices:
            self._devices[device] = await self._root.add_folder(self._id(device), self._name(device))
        folder = await self._devices[device].add_folder(self._id(f"{device}.{channel}"), self._name(channel))
        nodes = {quantity.key: await self._variable(folder, device, channel, quantity) for quantity in ROW}
        text = ua.VariantType.String
        about = {"flags": ([""], text), "boot": ("", text), "seq": (0, ua.VariantType.Int64)}
        for name, (first, kind) in about.items():
            node = await folder.add_variable(self._id(f"{device}.{channel}.{name}"), self._name(name), first, kind)
            nodes[name] = node.nodeid
        made = self._channels[device, channel] = _Channel(nodes)
        return made

    async def _variable(self, folder: Any, device: str, channel: str, quantity: Quantity) -> ua.NodeId:
        """A variable with its unit, of the type AnalogUnitType."""
        place = self._id(f"{device}.{channel}.{quantity.key}")
        node = await folder.add_variable(place, self._name(quantity.key), 0.0, ua.VariantType.Double)
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
            self._id(f"{device}.{channel}.{quantity.key}.EngineeringUnits"),
            ua.QualifiedName("EngineeringUnits", 0), unit(quantity),
        )  # fmt: skip
        return node.nodeid

    def _id(self, text: str) -> ua.NodeId:
        return ua.NodeId(text, self._index)

    def _name(self, text: str) -> ua.QualifiedName:
        return ua.QualifiedName(text, self._index)


def unit(quantity: Quantity) -> ua.EUInformation:
    """Of a quantity: the number is that of the characters of its common code (OPC 10000-8, 5.6.4.3)."""
    number = int.from_bytes(quantity.unece.encode(), "big")
    return ua.EUInformation(_UNITS, number, ua.LocalizedText(quantity.unit or "1"), ua.LocalizedText(quantity.title))


def _values(row: PowerRow) -> dict[str, ua.DataValue]:
    status, time = status_of(row.flags), datetime.fromisoformat(row.time)
    now = datetime.now(UTC)

    def value(variant: ua.Variant, code: ua.StatusCode) -> ua.DataValue:
        return ua.DataValue(variant, code, SourceTimestamp=time, ServerTimestamp=now)

    values = {
        "flags": value(ua.Variant(row.flags, ua.VariantType.String, is_array=True), GOOD),
        "boot": value(ua.Variant(row.boot, ua.VariantType.String), GOOD),
        "seq": value(ua.Variant(row.seq, ua.VariantType.Int64), GOOD),
    }
    for quantity in ROW:
        number = getattr(row, quantity.key)
        known = number is not None
        variant = ua.Variant(number, ua.VariantType.Double) if known else ua.Variant(None, ua.VariantType.Null)
        values[quantity.key] = value(variant, status if known else ABSENT)
    return values
