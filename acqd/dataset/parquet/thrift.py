"""Thrift's compact protocol, in which Parquet writes its headers: structures of integers, texts, lists, structures.

A structure is a dict from the number of a field to its value. Written are int (64 bit), I32, bool, str, bytes, lists
of these, and structures; read is everything that the protocol has. Source: thrift-compact-protocol.md of Apache Thrift.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from acqd.varint import varint

Structure = dict[int, Any]
_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
_DEEPEST = 16
"""Structures within structures; Parquet's metadata has 7."""


class I32(int):
    """An integer that is written as one of 32 bits."""


def encoded(structure: Mapping[int, Any]) -> bytes:
    """The bytes of a structure; fields that are None are left out."""
    done, last = bytearray(), 0
    for number, value in sorted(structure.items()):
        if value is None:
            continue
        kind = (_TRUE if value else _FALSE) if isinstance(value, bool) else _kind(value)
        done += bytes([number - last << 4 | kind]) if number - last < 16 else bytes([kind]) + varint(number << 1)
        last = number
        if not isinstance(value, bool):
            done += _content(value)
    return bytes(done) + b"\0"


def _kind(value: Any) -> int:
    kinds = ((I32, _I32), (int, _I64), (str | bytes, _BINARY), (list, _LIST), (dict, _STRUCT))
    return next(kind for of, kind in kinds if isinstance(value, of))


def _content(value: Any) -> bytes:
    if isinstance(value, int):
        return varint(value << 1 if value >= 0 else (-value << 1) - 1)  # zigzag
    if isinstance(value, str | bytes):
        data = value.encode() if isinstance(value, str) else value
        return varint(len(data)) + data
    if isinstance(value, dict):
        return encoded(value)
    kind = _kind(value[0]) if value else _BYTE
    head = bytes([len(value) << 4 | kind]) if len(value) < 15 else bytes([0xF0 | kind]) + varint(len(value))
    return head + b"".join(map(_content, value))


class Reader:
    """Reads structures from `data`, from the byte `position` on. All methods raise ValueError for damaged data."""

    def __init__(self, data: bytes, position: int = 0) -> None:
        self._data, self.position = data, position

    def structure(self, depth: int = 0) -> Structure:
        """The next structure; texts are bytes."""
        if depth > _DEEPEST:
            raise ValueError("structures within structures")
        fields, number = Structure(), 0
        while head := self._byte():
            kind, step = head & 0x0F, head >> 4
            number = number + step if step else self._integer()
            fields[number] = kind == _TRUE if kind in (_TRUE, _FALSE) else self._value(kind, depth)
        return fields

    def varint(self) -> int:
        """A natural number of at most 64 bits."""
        value = 0
        for shift in range(0, 70, 7):
            byte = self._byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise ValueError("a number of more than 64 bits")

    def _byte(self) -> int:
        return self._bytes(1)[0]

    def _bytes(self, count: int) -> bytes:
        start, self.position = self.position, self.position + count
        if self.position > len(self._data):
            raise ValueError("a structure without an end")
        return self._data[start : self.position]

    def _integer(self) -> int:
        value = self.varint()
        return -((value + 1) >> 1) if value & 1 else value >> 1

    def _value(self, kind: int, depth: int) -> Any:
        if kind in (_TRUE, _FALSE, _BYTE):  # of a list, where truth values take a byte
            return self._byte()
        if kind in (_I16, _I32, _I64):
            return self._integer()
        if kind == _DOUBLE:
            return self._bytes(8)
        if kind == _BINARY:
            return self._bytes(self.varint())
        if kind in (_LIST, _SET):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self.varint()
            if count > len(self._data) - self.position:
                raise ValueError("a list that is longer than its data")
            return [self._value(head & 0x0F, depth) for _ in range(count)]
        if kind == _STRUCT:
            return self.structure(depth + 1)
        raise ValueError(f"a field of the kind {kind}")
