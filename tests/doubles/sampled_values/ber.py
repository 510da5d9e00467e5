"""Basic encoding rules of the few ASN.1 types in a sampled-values frame (ITU-T X.690)."""

from __future__ import annotations


def length(count: int, octets: int = 0) -> bytes:
    """Length field for `count` octets of contents (X.690 8.1.3): the shortest form, or a long form of `octets` octets.

    X.690 permits a longer form than necessary; some merging units send 0x82 0x00 0x5F.
    """
    if octets == 0 and count < 0x80:
        return bytes([count])
    size = max(octets, (count.bit_length() + 7) // 8, 1)
    return bytes([0x80 | size]) + count.to_bytes(size, "big")


def element(tag: int, contents: bytes, octets: int = 0) -> bytes:
    """Tag, length and contents; `octets` as in `length`."""
    return bytes([tag]) + length(len(contents), octets) + contents


def integer(value: int) -> bytes:
    """Contents of an INTEGER >= 0 in the fewest octets (X.690 8.3): 200 becomes 0x00 0xC8."""
    return value.to_bytes(value.bit_length() // 8 + 1, "big")
