"""Natural numbers, seven bits a byte, the lowest first (unsigned LEB128): of protocol buffers and of Thrift."""

from __future__ import annotations


def varint(value: int) -> bytes:
    """The bytes of a natural number; every byte but the last has its highest bit set."""
    done = bytearray()
    while value > 0x7F:
        done.append(value & 0x7F | 0x80)
        value >>= 7
    done.append(value)
    return bytes(done)
