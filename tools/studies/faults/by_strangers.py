"""Faults by other clients of the broker: broken, huge, repeated, forged messages, and many."""

from __future__ import annotations

import json
import random
import socket
import time
from contextlib import suppress
from typing import Any

import orjson

from acqd.errors import UserError
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.timestamps import filetime, rfc3339
from tools.studies.faults.bed import DEVICE, Bed
from tools.studies.faults.fault import Fault
from tools.studies.faults.messages import publish

_WINDOW_NS = 40_000_000
_FIRST_ROW_S = 60.0
_BURST_DEVICES, _BURST_WINDOWS = 10, 75
"""Ten times the daemon's rate, for 3 s."""
_GARBAGE = (b"garbage", b"{}", b"[]", b"null", b'{"state":1}', b'{"state":"online","sink":5}', b"\xff\xfe", b"1")
_GARBAGE_TOPICS = (
    *(f"acqd/{DEVICE}/{name}" for name in ("receipt", "ask", "answer", "registers", "event", "windows")),
    *(f"acqd/{DEVICE}/{name}" for name in ("L1/power", "total/power", "L1/summary", "L1/quality")),
    *(f"acqd/sink/{name}" for name in ("faults/answer", "x/status")),
)
"""Not the status topics of both services, which they write themselves."""
_HOSTILE: list[dict[str, Any]] = [
    {"seq": 2**63}, {"seq": -1}, {"seq": 1.5}, {"seq": True}, {"boot": "b\0"}, {"boot": ""}, {"boot": "x" * 5000},
    {"filetime": 9 * 10**18}, {"filetime": -1}, {"time": "+30000-01-01T00:00:00Z"}, {"time": "9999-12-31T23:59:60Z"},
    {"P": "1"}, {"P": [1]}, {"W": 10**400}, {"flags": "gap"}, {"flags": [1]}, {"schema": 2}, {"channel": "L9"},
    {"device": "cell1/+"}, {"device": "../../etc"},
]  # fmt: skip


def garbage(bed: Bed, chance: random.Random) -> None:
    """Messages that are no rows: they belong into quarantine and delay nobody."""
    topic = f"acqd/{DEVICE}/L1/power"
    messages = [b"", b"{", b"[]", b"\xff" * 100, b'{"device":"' + b"x" * chance.randint(10, 300_000) + b'"}']
    publish(bed.proxies["daemon"].port, [(topic, chance.choice(messages)) for _ in range(20)])


def oversized(bed: Bed, chance: random.Random) -> None:
    """Messages far larger than any row: nobody's memory may follow them."""
    size = chance.randint(2_000_000, 20_000_000)
    publish(bed.proxies["daemon"].port, [(f"acqd/{DEVICE}/L1/power", b"[" * size)] * 2)


def again(bed: Bed, chance: random.Random) -> None:
    """Rows of the tape a second time: they are known."""
    lines = bed.tape.read_bytes().splitlines()[-400:]
    rows = [chance.choice(lines) for _ in range(40)] if lines else []
    publish(bed.proxies["daemon"].port, [(f"acqd/{DEVICE}/{_channel(row)}/power", row) for row in rows])


def _channel(row: bytes) -> str:
    return row.split(b'"channel":"', 1)[1].split(b'"', 1)[0].decode()


def hostile(bed: Bed, chance: random.Random) -> None:
    """Rows with one value that no row has: each belongs into quarantine."""
    row = _newest(bed)
    messages = [row | {"boot": "hostile"} | change for change in chance.sample(_HOSTILE, len(_HOSTILE))]
    texts = [_text(message) for message in messages]
    publish(bed.proxies["daemon"].port, [(f"acqd/{DEVICE}/{row['channel']}/power", text) for text in texts])


def forged(bed: Bed, chance: random.Random) -> None:
    """Rows of the present boot that the daemon has not made yet: its rows are not to vanish behind them."""
    row, ahead = _newest(bed) | {"channel": "L1"}, chance.randint(25, 100)
    rows = [
        orjson.dumps(row | {"seq": row["seq"] + k, "filetime": row["filetime"] + 400_000 * k, "P": 1e6})
        for k in range(ahead, ahead + 20)
    ]
    with bed.forged.open("ab") as file:
        file.write(b"".join(text + b"\n" for text in rows))
    publish(bed.proxies["daemon"].port, [(f"acqd/{DEVICE}/L1/power", text) for text in rows])


def receipts(bed: Bed, _chance: random.Random) -> None:
    """Receipts of a megabyte for rows that nobody has made: they may not stop the rows."""
    ranges = [[k, k] for k in range(2**40, 2**40 + 90_000, 2)]
    boot = _newest(bed)["boot"]
    receipt = {"sink": "s", "stored": [{"channel": "L1", "boot": boot, "seq": ranges}], "schema": 1}
    publish(bed.proxies["daemon"].port, [(f"acqd/{DEVICE}/receipt", orjson.dumps(receipt))] * 3)


def idle(bed: Bed, chance: random.Random) -> None:
    """As many clients as the embedded broker has places log in and say nothing; then the sink has to come back."""
    hello = b"\x10\x0f\x00\x04MQTT\x04\x02\x00\x3c\x00\x03"
    clients = []
    for k in range(98):
        with suppress(OSError):
            client = socket.create_connection(("127.0.0.1", bed.port), 2.0)
            client.sendall(hello + f"{k:03d}".encode())
            clients.append(client)
    time.sleep(chance.uniform(5.5, 7.0))
    bed.sink.kill()
    bed.sink.start()
    time.sleep(2.0)
    for client in clients:
        client.close()


def burst(bed: Bed, _chance: random.Random) -> None:
    """Ten devices publish three seconds of rows at once."""
    begin, boot = time.time_ns() - _BURST_WINDOWS * _WINDOW_NS, f"burst{time.time_ns()}"
    rows = [
        _burst_row(f"burst{device}", channel, boot, k, begin)
        for k in range(_BURST_WINDOWS)
        for device in range(_BURST_DEVICES)
        for channel in CHANNELS
    ]
    with bed.strangers.open("ab") as file:
        file.write(b"".join(row.to_json() + b"\n" for row in rows))
    publish(bed.port, [(f"acqd/{row.device}/{row.channel}/power", row.to_json()) for row in rows])


def _burst_row(device: str, channel: Any, boot: str, k: int, begin_ns: int) -> PowerRow:
    ns = begin_ns + k * _WINDOW_NS
    return PowerRow(device, channel, boot, k, rfc3339(ns), filetime(ns), 230.1, 1.2, 270.3, 276.1, 0.98, 50.0, 0.0, [])


def _newest(bed: Bed) -> dict[str, Any]:
    """The last row of the tape; on a busy computer the first one takes its time. Raises UserError."""
    deadline = time.monotonic() + _FIRST_ROW_S
    while time.monotonic() < deadline:
        with bed.tape.open("rb") as file:
            file.seek(max(0, bed.taped() - 4096))
            *whole, _ = file.read().split(b"\n")
        if whole:
            row: dict[str, Any] = orjson.loads(whole[-1])
            return row
        time.sleep(0.1)
    raise UserError(f"faults: no row within {_FIRST_ROW_S:g} s; see {bed.tape.parent}")


def _text(row: dict[str, Any]) -> bytes:
    """JSON, also of numbers that orjson does not write."""
    return json.dumps(row).encode()


def retained(bed: Bed, chance: random.Random) -> None:
    """The broker keeps garbage on topics of acqd, and both services start again with that before their eyes."""
    garbage = [(topic, chance.choice(_GARBAGE)) for topic in _GARBAGE_TOPICS]
    publish(bed.port, garbage, retain=True)
    for process in (bed.sink, bed.daemon):
        process.stop()
        process.start()
    time.sleep(chance.uniform(2.0, 4.0))
    publish(bed.port, [(topic, b"") for topic in _GARBAGE_TOPICS], retain=True)


FAULTS: dict[str, Fault] = {
    "malformed messages": garbage,
    "oversized messages": oversized,
    "duplicate messages": again,
    "hostile rows": hostile,
    "forged rows": forged,
    "forged receipts": receipts,
    "retained garbage": retained,
    "idle clients": idle,
    "10 x load": burst,
}
