"""What comes by MQTT, and a frame of sampled values."""

from __future__ import annotations

from typing import Any

import orjson

from tools.studies.fuzz.mutate import Files


def row(**more: Any) -> dict[str, Any]:
    """A row with other values in some fields."""
    return {
        "device": "box", "channel": "L1", "boot": "b1", "seq": 7, "time": "2026-11-22T10:00:00.000000Z",
        "filetime": 134_082_324_000_000_000, "Vrms": 230.1, "Irms": 1.2, "P": 250.0, "S": 276.1, "PF": 0.9, "f": 50.01,
        "W": 1.5, "flags": ["simulated"], "schema": 1,
    } | more  # fmt: skip


def rows() -> list[Files]:
    """A row, and one without mains."""
    return [{"row.json": orjson.dumps(row())}, {"row.json": orjson.dumps(row(f=None, PF=None, flags=["no_mains"]))}]


def receipts() -> list[Files]:
    """Of rows, and the answer to a question."""
    stored = [{"channel": "L1", "boot": "b1", "seq": [[0, 24], [26, 49]]}]
    last = [{"channel": "L1", "boot": "b1", "seq": 49, "W": 0.5}]
    return [
        {"receipt.json": orjson.dumps({"sink": "s", "stored": stored, "schema": 1})},
        {"receipt.json": orjson.dumps({"sink": "s", "stored": [], "schema": 1, "last": last})},
    ]


def asks() -> list[Files]:
    """Questions; a status; a summary: what is heard is one of them."""
    who = {"instance": "i2", "boot": "b2", "host": "h", "since": "2026-11-22T10:00:00Z", "taken": False}
    heard: list[dict[str, Any]] = [
        {"ask": "last_rows", "boot": "b1", "who": None, "schema": 1},
        {"ask": "name", "boot": "", "who": who, "schema": 1},
        {"state": "online", "boot": "b2", "started": "2026-11-22T10:00:00Z", "name": who},
        {"channel": "L1", "boot": "b", "seq": 3, "W_import": 1.0, "W_export": 0.0},
    ]
    return [{"heard.json": orjson.dumps(one)} for one in heard]


def events() -> list[Files]:
    """The begin of a dip, and a rapid change."""
    dip = {
        "device": "box", "boot": "b1", "number": 7, "kind": "dip", "time": "2026-11-22T10:00:00.000000Z",
        "filetime": 134_082_324_000_000_000, "duration": None, "extreme": 161.0, "reference": 230.0, "sliding": False,
        "steady_change": None, "phases": ["L1", "L3"], "flags": ["simulated"], "waveform": "a.npz", "schema": 1,
    }  # fmt: skip
    change = dip | {"kind": "rvc", "duration": 0.02, "steady_change": 14.5, "waveform": None}
    return [{"event.json": orjson.dumps(dip)}, {"event.json": orjson.dumps(change)}]


def sampled_values() -> list[Files]:
    """A frame of IEC 61850-9-2LE with one ASDU of eight values."""
    data = b"".join(value.to_bytes(4, "big", signed=True) + b"\x00" * 4 for value in range(0, 8000, 1000))
    asdu = b"\x80\x06MU0101\x82\x02\x00\x07\x83\x04\x00\x00\x00\x01\x85\x01\x02\x87" + bytes([len(data)]) + data
    sequence = b"\x30" + bytes([len(asdu)]) + asdu
    pdu = b"\x80\x01\x01\xa2" + bytes([len(sequence)]) + sequence
    apdu = b"\x60" + bytes([len(pdu)]) + pdu
    header = b"\x01\x0c\xcd\x04\x00\x01" + b"\x02" * 6 + b"\x88\xba\x40\x00"
    return [{"frame.bin": header + (len(apdu) + 8).to_bytes(2, "big") + b"\x00" * 4 + apdu}]


def joints() -> list[Files]:
    """A row of live joints."""
    return [{"joints.json": orjson.dumps({"time": 1_700_000_000.0, "q": [0.1] * 6, "brake": 1, "tool": 0})}]
