"""Whether the broker takes rows: with MQTT 3.1.1 it acknowledges also what its access rules refuse.

MQTT 5 has a reason in the acknowledgement (OASIS standard, section 3.4.2.1). Rows go by 3.1.1, where a broker does not
limit how many may be under way; so a second connection publishes one message of every topic again, which changes
nothing, for rows have keys, and looks at the reasons.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence

from acqd.telemetry import topics, wire
from acqd.telemetry.message import Message, Room
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.session import Session, SessionError

_ANSWER_S = 3.0


class _Nothing:
    """No outbox: messages are sent by hand."""

    def subscriptions(self) -> list[str]:
        return []

    def begin(self) -> None:
        pass

    def ready(self, line: object) -> None:
        pass

    def end(self) -> None:
        pass

    async def take(self, room: Room) -> list[Message]:  # noqa: ARG002
        return []

    async def wait(self) -> None:
        pass

    def acknowledged(self, message: Message) -> None:
        pass

    def received(self, topic: str, payload: bytes, *, retained: bool) -> None:
        pass

    def __len__(self) -> int:
        return 0


async def refused(
    address: BrokerAddress, client_id: str, device: str, messages: Sequence[Message]
) -> dict[str, str] | None:
    """Topics that the broker refuses, with its reason. None: it does not say, as one without MQTT 5."""
    will = Message(topics.ask(device), b"{}")  # nobody understands it
    try:
        async with Session(address, client_id, will, _Nothing(), version=wire.V5) as session:
            session.send(*messages)
            deadline = time.monotonic() + _ANSWER_S
            while len(session.window) and time.monotonic() < deadline:
                session.check()
                await asyncio.sleep(0.02)
            return session.refused if not len(session.window) else None
    except SessionError:
        return None
