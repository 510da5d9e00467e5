"""The sink: MQTT -> SQL; after the commit, a receipt to the daemon and an acknowledgement to the broker.

One thread keeps the connection, another one writes: rows arrive while a batch is being committed. A durable MQTT 5
session: the broker keeps what a sink that is away has not confirmed. Several sinks share the work through a shared
subscription when they are given a group. Not by default: mosquitto 2.0.11 (Debian 12) forgets a shared subscription
when it restarts, until its client is back, and drops what is published in between; a plain one it keeps. MQTT 3.1.1
where the broker knows no 5.
"""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Callable

import orjson
import sqlalchemy as sa

from acqd import __version__
from acqd.changes import Repeats
from acqd.retry import LOCAL_NETWORK, Backoff
from acqd.storage.clock_witness import ClockWitness
from acqd.storage.committer import Batch, Committer
from acqd.storage.database_witness import DatabaseWitness
from acqd.storage.refusals import Refusals
from acqd.storage.sink_hello import hello
from acqd.storage.sink_settings import SinkCounters, SinkSettings
from acqd.storage.writer import Writer, Written
from acqd.telemetry import topics
from acqd.telemetry.mqtt import BrokerAddress, is_refusal, refusal
from acqd.telemetry.receipts import answer, receipts
from acqd.telemetry.subscriber import NO_ANSWER, Subscriber, SubscriberError
from acqd.telemetry.wire import UNSUPPORTED, V5, V311, Publish
from acqd.timestamps import rfc3339

_log = logging.getLogger(__name__)
_TOPICS = (
    topics.ALL_POWER,
    topics.ALL_WINDOWS,
    topics.ALL_QUALITY,
    topics.ALL_REGISTERS,
    topics.ALL_EVENTS,
    topics.ALL_ASKS,
)
_STOP_S = 1.0
_BATCH_BYTES, _HELD_BYTES = 4 << 20, 16 << 20
"""Payloads of one transaction, and of all messages that are not acknowledged."""
_PROGRESS_S = 0.5
_BRIEF = 2
"""From so many brief connections on, the trouble stays in the status until one has lasted: two sinks of one client_id
are connected by turns."""
_LAG_KNOWN_S = 5.0
"""How long the lag of the last batch says something."""


class Sink:
    """Receives, has batches written, acknowledges."""

    def __init__(
        self,
        address: BrokerAddress,
        engine: sa.Engine,
        settings: SinkSettings | None = None,
        *,
        prepared: bool = True,
        witness: ClockWitness | None = None,
        memory: DatabaseWitness | None = None,
    ) -> None:
        """Without `prepared`, the database is away, and opened when it comes."""
        self._address, self._engine, self._prepared = address, engine, prepared
        self._settings = settings or SinkSettings()
        address.tls_context()  # files that cannot be used are an error of the start
        self._writer = Writer(engine, self._settings.malformed_bytes_per_day, self._settings.client_id, witness, memory)
        self._quarantining = Repeats(_log)
        self._version = V5 if self._settings.mqtt5 else V311
        self._unanswered = 0
        self._subscriber: Subscriber | None = None
        self._arrived: list[Publish] = []
        self._held = self._under_way = self._asked = 0
        self._recalled = ""
        self._since = self._fed = 0.0
        self._announced, self._announced_at = False, 0.0
        self._brief = 0
        """Connections that have ended within seconds, one after another."""
        self._said: set[str] = set()
        self._started = rfc3339(time.time_ns())
        self.counters = SinkCounters()

    @property
    def connected(self) -> bool:
        """Whether the broker has taken our subscription (a backlog of rows may come before the acknowledgement)."""
        return self._subscriber is not None and self._subscriber.subscribed

    @property
    def refusals(self) -> Refusals:
        """Rows that a changed table refuses."""
        return self._writer.refusals

    def run(self, stop: Callable[[], bool], progress: Callable[[], None] = lambda: None) -> None:
        """Until `stop()`; `progress` is called at least every second. A broker that refuses is tried again.

        Raises UserError when a database that was away comes back and cannot be used.
        """
        self._progress = progress
        committer = Committer(self._engine, self._writer, prepared=self._prepared)
        backoff, said = Backoff(), ""
        try:
            while not stop():
                begun, failure = time.monotonic(), ""
                try:
                    self._session(committer, stop)
                except SubscriberError as error:
                    failure = str(error)
                if stop():
                    return
                if self._step_down(failure):
                    continue
                lasted_s = time.monotonic() - begun
                if self._announced:
                    backoff.ended(lasted_s)
                if self._announced and lasted_s > LOCAL_NETWORK.stable_s:
                    said, self._brief = "", 0
                elif self._announced:  # a client of the same name may have taken the connection over
                    failure += f" (does another sink use the client_id {self._settings.client_id}?)"
                    self._brief += 1
                self.counters.broker_trouble = failure
                if failure != said:
                    _say(self._address, failure)
                said = failure
                self._pause(committer, backoff.pause_s(), stop)
        finally:
            committer.close(_STOP_S)

    def _step_down(self, failure: str) -> bool:
        """Whether to try the other version of MQTT at once; the one that was accepted last is kept.

        Some brokers do not answer to a version that they do not know.
        """
        if not self._settings.mqtt5 or self._announced:
            return False
        silent = failure == NO_ANSWER
        if self._version == V5:
            self._unanswered = self._unanswered + 1 if silent else 0
            if failure == UNSUPPORTED or self._unanswered > bool(self._settings.group):  # only MQTT 5 shares rows
                self._version, self._unanswered = V311, 0
                return True
        elif silent:
            self._version = V5
        return False

    def _pause(self, committer: Committer, seconds: float, stop: Callable[[], bool]) -> None:
        """Wait; what is committed meanwhile needs no acknowledgement, for the broker sends it again."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and not stop():
            self._count(committer)
            self._feed_watchdog()
            time.sleep(0.05)

    def _session(self, committer: Committer, stop: Callable[[], bool]) -> None:
        """One connection. Raises SubscriberError when it ends."""
        self._arrived, self._held, self._under_way, self._announced = [], 0, 0, False
        subscriber = Subscriber(self._address, hello(self._address, self._settings, self._version))
        try:
            subscriber.connect()
            self._subscriber = subscriber
            self.counters.certificate = subscriber.certificate
            self.counters.reconnects += 1
            if self._settings.group and self._version == V5:
                # A session from a time without sharing would get every row.
                shared = [f"$share/{self._settings.group}/{topic}" for topic in _TOPICS]
                subscriber.subscribe(*shared, leave=_TOPICS)
            else:
                subscriber.subscribe(*_TOPICS)
            while not stop():
                self._turn(subscriber, committer)
        finally:
            self._subscriber = None
            farewell = (topics.sink_status(self._settings.client_id), topics.OFFLINE) if self._announced else None
            subscriber.close(farewell=farewell if stop() else None)

    def _turn(self, subscriber: Subscriber, committer: Committer) -> None:
        """Receive for a moment, pass batches on, answer what is committed."""
        settings = self._settings
        wait = settings.interval
        if self._arrived:  # a full committer wakes us when it has room
            wait = self._since + wait - time.monotonic() if committer.room else _PROGRESS_S
        room = self._under_way < 4 * settings.batch and self._held < _HELD_BYTES
        fresh = subscriber.receive(max(0.0, min(wait, _PROGRESS_S)), [committer.readable], read=room)
        if fresh and not self._arrived:
            self._since = time.monotonic()
        self._arrived += fresh
        self._held += sum(len(message.payload) for message in fresh)
        self._under_way += len(fresh)
        self._answer(subscriber, committer)
        due = len(self._arrived) >= settings.batch or self._held >= _BATCH_BYTES
        if self._arrived and committer.room and (due or time.monotonic() >= self._since + settings.interval):
            self._submit(committer)
        if not self._arrived and not committer.busy and time.monotonic() - self._since > _LAG_KNOWN_S:
            self.counters.lag_s = 0.0
        self._announce(subscriber)
        self._feed_watchdog()

    def _submit(self, committer: Committer) -> None:
        count = size = 0
        while count < min(len(self._arrived), self._settings.batch) and size < _BATCH_BYTES:
            size += len(self._arrived[count].payload)
            count += 1
        batch, self._arrived = self._arrived[:count], self._arrived[count:]
        committer.submit(Batch(batch, [message.number for message in batch], self.counters.reconnects, self._since))

    def _answer(self, subscriber: Subscriber, committer: Committer) -> None:
        """Receipts first: an acknowledged row does not come again."""
        for batch, written in self._count(committer):
            for topic, payload in receipts(self._settings.client_id, written.receipts, self._writer.guard.commits):
                subscriber.publish(topic, payload)
            for asked, last in written.answers.items():
                subscriber.publish(*answer(self._settings.client_id, *asked, last))
            if batch.connection == self.counters.reconnects:
                subscriber.acknowledge([number for number in batch.numbers if number])
                self._under_way -= len(batch.numbers)
                self._held -= sum(len(message.payload) for message in batch.messages)
        guard = self._writer.guard
        self.counters.recalls = guard.restored
        if self._announced and (self._asked, self._recalled) != (guard.recall, guard.recalled):
            subscriber.publish(topics.sink_status(self._settings.client_id), self._announcement(), retain=True)

    def _announcement(self) -> bytes:
        """`recalled`: daemons that were away when the rows were asked for find that when they come back."""
        guard = self._writer.guard
        asked, self._asked, self._recalled = self._asked, guard.recall, guard.recalled
        content = {"state": "online", "sink": self._settings.client_id, "schema": 1, "version": __version__}
        content |= {"host": socket.gethostname(), "started": self._started}
        content |= {"recalled": self._recalled} if self._recalled else {}
        content |= {"recall": True} if self._asked > asked else {}
        return orjson.dumps(content)

    def _count(self, committer: Committer) -> list[tuple[Batch, Written]]:
        """What was committed since the last call."""
        counters, done = self.counters, committer.done()
        counters.database_trouble, counters.database_returns = committer.trouble, committer.returns
        counters.clock_trouble = self._writer.witness.trouble
        counters.boots_trouble = self._writer.boots.trouble
        counters.refused_trouble = self._writer.refusals.trouble
        for subject, trouble in (
            ("clock", counters.clock_trouble),
            ("name", counters.boots_trouble),
            ("refused", counters.refused_trouble),
        ):
            if trouble and subject not in self._said:
                _log.error("%s", trouble)
            (self._said.add if trouble else self._said.discard)(subject)
        for batch, written in done:
            malformed = written.quarantined - written.conflicts - written.impossible
            count = self._quarantining.count
            count(malformed, "%d malformed messages put into quarantine")
            count(written.impossible, "%d rows with impossible times put into quarantine")
            count(
                written.conflicts, "%d rows put into quarantine: other rows with their keys are stored", logging.ERROR
            )
            counters.impossible += written.impossible
            counters.lag_s = time.monotonic() - batch.begun
            counters.rows += written.rows
            counters.quarantined += written.quarantined
            counters.conflicts += written.conflicts
            counters.batches += 1
            counters.last_commit = time.monotonic()
        if not committer.trouble:  # a commit that does not end says nothing by itself
            counters.lag_s = max(counters.lag_s, committer.waits_s)
        return done

    def _announce(self, subscriber: Subscriber) -> None:
        """Once the subscription stands, tell the daemons: from now on rows reach us."""
        if subscriber.refused:
            raise SubscriberError(f"{subscriber.refused}; check the broker's access rules for {topics.ALL_POWER}")
        if self._announced:
            if self._brief and time.monotonic() - self._announced_at > LOCAL_NETWORK.stable_s:
                self._brief, self.counters.broker_trouble = 0, ""
            return
        if not subscriber.subscribed:
            return
        self._announced, self._announced_at = True, time.monotonic()
        if self._brief < _BRIEF:
            self.counters.broker_trouble = ""
        for topic in subscriber.refused_topics:
            _log.warning("the broker refuses %s: rows that come there are not stored; check its access rules", topic)
        subscriber.publish(topics.sink_status(self._settings.client_id), self._announcement(), retain=True)
        version = "5" if self._version == V5 else "3.1.1"
        group = self._settings.group
        sharing = f", sharing in group {group}" if group and self._version == V5 else ""
        _log.info("connected to broker %s (MQTT %s%s)", self._address, version, sharing)
        if group and not sharing:
            _log.warning("this broker speaks no MQTT 5: rows cannot be shared between sinks")

    def _feed_watchdog(self) -> None:
        now = time.monotonic()
        if now - self._fed >= _PROGRESS_S:
            self._fed = now
            self._progress()


def _say(address: BrokerAddress, failure: str) -> None:
    if is_refusal(failure):
        _log.error("%s; trying again", refusal(address, failure))
    else:
        _log.warning("broker %s: %s; retrying", address, failure)
