"""What a daemon says and hears besides rows: about its name, and about the last rows before a power cut."""

from __future__ import annotations

from collections.abc import Callable

from msgspec import UNSET

from acqd.telemetry import topics
from acqd.telemetry.last_rows import LastRows
from acqd.telemetry.message import Message
from acqd.telemetry.name import Name
from acqd.telemetry.receipts import Receipt
from acqd.telemetry.register_witness import RegisterWitness


class Dialogue:
    """Of one daemon; for one event loop."""

    def __init__(
        self, device: str, name: Name, last_rows: LastRows, registers: RegisterWitness, greet: Callable[[], None]
    ) -> None:
        """`greet` publishes the status."""
        self._name, self._last_rows, self._registers, self._greet = name, last_rows, registers, greet
        self._status, self._ask = topics.status(device), topics.ask(device)

    @property
    def may_publish(self) -> bool:
        """Whether rows and states may go out."""
        return self._name.held

    def subscriptions(self) -> list[str]:
        """Status and questions of our name, and the answers to ours."""
        asked = [self._status, self._ask, *self._last_rows.subscriptions(), *self._registers.subscriptions()]
        return list(dict.fromkeys(asked))

    def begin(self) -> None:
        """A new connection."""
        self._name.begin()

    def said(self) -> list[Message]:
        """Questions that are due."""
        if self._name.turn():
            self._greet()
        question = self._name.question()
        about_name = [Message(self._ask, question)] if question is not None else []
        return about_name + self._last_rows.questions()

    def heard(self, topic: str, payload: bytes, *, retained: bool) -> None:
        """A status, a question or a summary."""
        if topic == self._status:
            again = self._name.heard_status(payload, retained=retained)
        elif topic == self._ask:
            again = self._name.heard_ask(payload)
        else:
            again = False
            self._last_rows.heard_summary(topic, payload)
            self._registers.heard(topic, payload, retained=retained)
        if again:
            self._greet()

    def answered(self, device: str, receipt: Receipt) -> None:
        """A receipt; it may hold the last rows."""
        if receipt.last is not UNSET:
            self._last_rows.answered(device, receipt)
