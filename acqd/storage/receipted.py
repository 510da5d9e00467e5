"""What gets a receipt: rows that are stored, and messages in quarantine that name themselves."""

from __future__ import annotations

from typing import Any

import orjson

from acqd.storage.received import Message
from acqd.telemetry import topics
from acqd.telemetry.event import message_number
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool import Stream


def note(receipts: dict[Stream, Ranges], device: str, channel: str, boot: str, seq: int) -> None:
    """A row is stored."""
    receipts.setdefault(Stream(device, channel, boot), Ranges()).add(seq, seq)


def note_refused(receipts: dict[Stream, Ranges], message: Message) -> None:
    """A receipt also for what is no valid row, where it names itself: nobody can make it better by sending it again."""
    try:
        content: Any = orjson.loads(message.payload)
        if topics.is_event(message.topic):
            seq = message_number(content["number"], ended=content["duration"] is not None)
            content |= {"channel": topics.EVENTS, "seq": seq}
        device, channel, boot, seq = (content[name] for name in ("device", "channel", "boot", "seq"))
        if {type(device), type(channel), type(boot)} != {str} or type(seq) is not int:
            return
        stream = channel
        if topics.is_quality(message.topic):
            stream = topics.quality_stream(channel)
        elif topics.is_registers(message.topic):
            stream = topics.register_stream(channel)
        own = message.topic in (topics.row(device, stream), topics.window(device))
        if own and 0 <= seq < 2**63:
            note(receipts, device, stream, boot, seq)
    except (ValueError, TypeError, KeyError):
        return
