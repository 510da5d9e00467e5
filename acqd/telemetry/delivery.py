"""What the daemon sends next: new rows at once, states, and at the same time the backlog, until every row is delivered.

A row is delivered when the policy says so. `stored`: a receipt of a sink names it. `acknowledged`: the broker has it.
New rows and the backlog each keep their order. The backlog leaves a part of the window free, so that new rows never
wait behind it.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Literal

from msgspec import UNSET

from acqd.telemetry import topics
from acqd.telemetry.acknowledgements import Acknowledgements, Rows
from acqd.telemetry.clock_match import ClockMatch
from acqd.telemetry.dialogue import Dialogue
from acqd.telemetry.earlier_state import CommitsHeard
from acqd.telemetry.in_flight import InFlight
from acqd.telemetry.message import Line, Message, Room
from acqd.telemetry.receipt_watch import AHEAD, ReceiptWatch
from acqd.telemetry.receipts import Announcement, announcement, parse_receipt, ranges_of
from acqd.telemetry.row_message import messages_of
from acqd.telemetry.spool import Readings, Spool, SpooledRow, Stream
from acqd.telemetry.unsent import Unsent

_log = logging.getLogger(__name__)
Until = Literal["stored", "acknowledged"]
_LIVE = 1_000
"""New rows that wait in memory for a slow connection; beyond that they come with the backlog."""
_WAIT_S = 0.5


class Delivery:
    """The outbox of the daemon, on top of the spool."""

    def __init__(
        self,
        spool: Spool,
        until: Until,
        devices: Iterable[str] = (),
        now: Callable[[], float] = time.monotonic,
        *,
        live: bool = True,
        windows: bool = False,
        dialogue: Dialogue | None = None,
    ) -> None:
        """`devices`: those whose rows will come, to subscribe to their receipts. `dialogue` says and hears the rest.

        Without `live`, new rows wait behind the backlog: one order for all, as a recording has it. With `windows`, the
        rows of a window travel in one message.
        """
        self._dialogue = dialogue
        self._windows, self._together = windows, 1
        self._most_live = _LIVE if live else 0
        self.spool, self._until, self._now = spool, until, now
        self._changed = asyncio.Event()
        self._later: asyncio.TimerHandle | None = None
        self._online = False
        self._line: Line | None = None
        self._live: deque[SpooledRow] = deque()
        self._states: dict[str, bytes] = {}
        self._position = spool.start
        self._flying, self._unsent = InFlight(), Unsent()
        self._clocks, self._commits = ClockMatch(), CommitsHeard()
        self._watch, self._acknowledgements = ReceiptWatch(self._flying, now), Acknowledgements()
        self._devices = spool.devices | set(devices)
        self._more = self._again = False
        self._backlog_open = True
        self.gone_back = 0
        """Times that receipts have shown the database of a sink in an earlier state of which the sink knows nothing."""
        self.sent = self.resent = self.delivered = 0
        """Rows published, those published again included; rows for which no receipt came in time; rows that the broker
        has acknowledged."""
        self.examples: dict[str, Message] = {}
        """The newest row of every topic that the broker has acknowledged."""

    def put_rows(self, rows: Sequence[SpooledRow], readings: Readings | None = None) -> None:
        """Keep the rows of a window, and send them at once where there is a connection."""
        if self._windows and rows and not topics.travels_alone(rows[0].stream.channel):
            self._together = sum(
                [row.seq == rows[0].seq and row.stream.device == rows[0].stream.device for row in rows]
            )
        # `room` hears acknowledgements: before the rows wait, so that none of these wakes the connector for them.
        room = 0 if self._line is None or self._silent else self._line.room().messages
        at_end = self._position == self.spool.end
        self._devices.update([row.stream.device for row in rows])
        kept = self.spool.append(rows, readings)
        if self._online and len(self._live) + len(rows) <= self._most_live:
            self._live += rows
            if at_end:
                self._position = self.spool.end
            if self._line is not None and 0 < len(self._live) <= room:  # without a turn of the event loop in between
                at_once = list(self._live)
                self._live.clear()
                self._line.send(self._messages(at_once))
                return
        elif self._live:
            self._live.clear()
            self._position = self.spool.start
        if kept:
            self._unsent.add(rows)
        self._changed.set()

    def put_state(self, topic: str, payload: bytes) -> None:
        """Publish a retained message; an older one of the same topic that still waits is replaced."""
        self._states[topic] = payload
        self._changed.set()

    def subscriptions(self) -> list[str]:
        """Receipts of the devices whose rows come from here, the sinks' announcements, and what the dialogue wants."""
        also = self._dialogue.subscriptions() if self._dialogue is not None else []
        if self._until == "acknowledged":
            return also
        return [topics.ALL_SINKS, *(topics.receipt(device) for device in sorted(self._devices)), *also]

    def say(self) -> None:
        """The dialogue has something to say, or rows may go out again."""
        self._changed.set()

    @property
    def _silent(self) -> bool:
        """Whether rows and states wait: another daemon has the name."""
        return self._dialogue is not None and not self._dialogue.may_publish

    def begin(self) -> None:
        """A new connection: the broker may have lost what it had."""
        self._online = True
        if self._dialogue is not None:
            self._dialogue.begin()
        self._watch.begin()
        self._from_the_start()
        self._changed.set()

    def ready(self, line: Line) -> None:
        """New rows may go out at once."""
        self._line = line

    def end(self) -> None:
        """The connection has ended: new rows wait in the spool."""
        self._online, self._line = False, None
        self._watch.end()
        if self._later is not None:
            self._later.cancel()
            self._later = None
        self._live.clear()
        self._settle(self._acknowledgements.believed())

    async def take(self, room: Room) -> list[Message]:
        """New rows, states, and as much of the backlog as there is room for."""
        self._changed.clear()
        self._settle(self._acknowledgements.believed())
        if self.spool.readable_again():
            self._position = self.spool.start
        said = self._dialogue.said() if self._dialogue is not None else []
        if self._silent:
            if self._live:
                self._live.clear()
                self._position = self.spool.start
            self._more = False
            return said
        rows = [self._live.popleft() for _ in range(min(len(self._live), room.messages * self._together))]
        messages = [*said, *self._messages(rows)]
        while self._states and len(messages) < room.messages:
            topic = next(iter(self._states))
            messages.append(Message(topic, self._states.pop(topic), retain=True))
        allowed = self._backlog_allowed()
        self._backlog_open = allowed > 0
        backlog = min(room.backlog, room.messages - len(messages), allowed)
        self._more = bool(messages) and bool(self._live or self._states or len(messages) >= room.messages)
        if backlog > 0 and not self._live and self._position != self.spool.end:
            rows, self._position = self.spool.read(
                self._position, backlog * self._together, lambda stream, seq: not self._flying.sent(stream, seq)
            )
            messages += self._messages(rows)
            self._more = self._position != self.spool.end  # there is more, or much of the backlog was to skip
        return messages

    async def wait(self) -> None:
        """Return when there may be something to send."""
        if self._more:
            await asyncio.sleep(0)  # metering comes first
            return
        if self._later is None:
            self._later = asyncio.get_running_loop().call_later(_WAIT_S, self._look)
        await self._changed.wait()

    def _look(self) -> None:
        """It may be time to send something again."""
        self._later = None
        self._changed.set()

    def acknowledged(self, message: Message) -> None:
        """The broker has the message: with that policy, its rows are delivered."""
        sent: Sequence[tuple[Stream, int]] = message.tag or ()
        if sent:
            self.examples[message.topic] = message
        self.delivered += len(sent)
        if self._until == "acknowledged":
            self._acknowledgements.add(sent)
        if self._live or self._states or (self._backlog_open and self._position != self.spool.end):
            self._changed.set()  # there is room for what waits; what waits for a receipt is looked at when one comes

    def doubt(self) -> None:
        """Acknowledged rows stay until it is known that the broker takes rows, and does not only acknowledge them."""
        self._acknowledgements.doubt()

    def ask(self) -> None:
        """The question whether the broker takes rows goes out now: it is about those acknowledged until now."""
        self._acknowledgements.ask()

    def trust(self) -> None:
        """The broker took rows when it was asked, or cannot be asked: what it had acknowledged before is delivered."""
        self._settle(self._acknowledgements.taken())
        self._changed.set()

    def again(self) -> None:
        """What the broker has acknowledged it has not taken: send all again."""
        self._acknowledgements.clear()
        self._from_the_start()
        self._changed.set()

    def received(self, topic: str, payload: bytes, *, retained: bool) -> None:
        """A receipt, or a sink that comes or goes."""
        _, middle, last = topic.split("/", 2)
        if last == "receipt":
            self._take_receipt(middle, payload)
        elif middle != "sink" or last == "status":
            if self._dialogue is not None:
                self._dialogue.heard(topic, payload, retained=retained)
        elif payload == topics.OFFLINE:
            if self._watch.left(topic) and not retained:  # the others get what it had taken with it
                self._from_the_start()
        else:
            self._watch.came(topic)
            self._recall(topic, announcement(payload), retained=retained)
            if not retained:  # what was sent before the sink had subscribed may never reach it
                self._from_the_start()
        self._changed.set()

    def _recall(self, topic: str, said: Announcement, *, retained: bool) -> None:
        """Send again what the database of a sink may lack; a sink of an earlier version does not name the event."""
        if not said.recalled and (retained or not said.recall):
            return
        self._send_again(topic, said.recalled)

    def _send_again(self, sink: str, event: str = "") -> None:
        """Delivered rows that are kept wait again, once for an event that has a name."""
        if again := self.spool.recall(sink, event):
            _log.warning("the database of %s may lack rows: %d stored ones are sent again", sink, again)
            self._from_the_start()

    @property
    def outstanding(self) -> int:
        """Rows that were sent and have no receipt yet."""
        return len(self._flying)

    @property
    def sink_seen(self) -> bool:
        """Whether a sink has ever announced itself or sent a receipt."""
        return self._watch.seen

    @property
    def sinks(self) -> frozenset[str]:
        """Status topics of the sinks that say that they are there."""
        return self._watch.sinks

    @property
    def unreceipted_s(self) -> float:
        """How long no receipt has come for rows that were sent, while a sink says that it is there [s]."""
        return 0.0 if self._until == "acknowledged" else self._watch.unreceipted_s

    @property
    def alone_s(self) -> float:
        """How long rows have waited for a sink while none is known [s]."""
        return 0.0 if self._until == "acknowledged" else self._watch.alone_s

    @property
    def receipt_lag_s(self) -> float:
        """How long rows wait for their receipt while a sink says that it is there, at most, of the last 10 s [s]."""
        return 0.0 if self._until == "acknowledged" else self._watch.lag_s

    @property
    def clock_trouble(self) -> str:
        """What is wrong with this computer's clock or a sink's, else empty."""
        return self._clocks.trouble

    def __len__(self) -> int:
        """Messages that wait: rows that are not delivered, states that are not sent."""
        return len(self.spool) - len(self._acknowledgements) + len(self._states)

    def _take_receipt(self, device: str, payload: bytes) -> None:
        try:
            message = parse_receipt(payload)
        except ValueError as error:
            _log.warning("receipt of %s cannot be read: %s", device, error)
            return
        if self._dialogue is not None:
            self._dialogue.answered(device, message)
        if message.time is not UNSET:
            self._clocks.heard(message.sink, message.time)
        if self._commits.gone_back(message):
            self.gone_back += 1
            self._send_again(message.sink)
        self._watch.receipt_comes()
        removed = expected = 0
        sent = self._now()
        for stream, *pair in ranges_of(device, message):
            for first, last in self._unsent.without(stream, *pair):
                removed += self.spool.remove(stream, first, last)
                if settled := self._flying.settle(stream, first, last):
                    expected += settled
                    sent = min(sent, self._flying.settled_sent)
        self._watch.receipt_came(removed, expected, sent)

    def _backlog_allowed(self) -> int:
        """Rows of the backlog that may be sent now."""
        if self._until == "acknowledged":
            return AHEAD
        if late := self._watch.overdue():
            self.resent += late
            self._again = True
        if self._again and self._position == self.spool.end:  # no earlier: a database may refuse some rows for days
            self._again, self._position = False, self.spool.start
        return self._watch.allowed()

    def _messages(self, rows: Sequence[SpooledRow]) -> list[Message]:
        now = self._now()
        self._watch.sending()
        self._flying.add(rows, now)
        if self._unsent:
            self._unsent.publish(rows)
        self.sent += len(rows)
        return messages_of(rows, windows=self._windows)

    def _settle(self, acknowledged: Iterable[Rows]) -> None:
        for streams in acknowledged:
            for stream, rows in streams.items():
                for first, last in rows:
                    self.spool.remove(stream, first, last)
                    self._flying.settle(stream, first, last)

    def _from_the_start(self) -> None:
        self._flying.clear()
        self._again = False
        self._position = self.spool.start
