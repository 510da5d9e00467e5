"""Whether the broker takes the rows that it acknowledges: access rules and limits may refuse them without a word."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Sequence
from dataclasses import replace

from acqd.changes import StateLog
from acqd.daemon.config import Config
from acqd.telemetry.ask import Claimant
from acqd.telemetry.connector import Connector
from acqd.telemetry.delivery import Delivery
from acqd.telemetry.rights import refused

_log = logging.getLogger(__name__)
_LOOK_S = 0.5
_REFUSED_S = 10.0
"""Access rules are changed by hand."""
_AGAIN_S = 5.0
"""Without receipts, rules that change during a connection are known by asking again only."""
_LATE_S = 2.0
"""Receipts that come later than this raise the question whether rows arrive."""
_AT_ONCE = 16
"""Topics of one question: fewer than the messages that any broker takes at once."""


class RightsWatch:
    """Asks the broker over a connection of its own; for the event loop of the delivery."""

    def __init__(self, config: Config, delivery: Delivery, connector: Connector, me: Claimant) -> None:
        self._config, self._delivery, self._connector = config, delivery, connector
        self._client_id = f"acqd-{config.device}-{me.boot}-rights"
        self._says = StateLog(_log)
        self._refused: dict[str, str] = {}

    @property
    def trouble(self) -> str:
        """Which rows the broker acknowledges and does not take, else empty."""
        if not self._refused:
            return ""
        topic, reason = next(iter(self._refused.items()))
        what = "message_size_limit" if "too large" in reason else "access rules"
        more = f" and {len(self._refused) - 1} topics more" if len(self._refused) > 1 else ""
        return f"the broker acknowledges rows and refuses them: {topic}{more} ({reason}); check its {what}"

    async def watch(self) -> None:
        """Ask, for each connection and kind of topic; does not end by itself.

        Where no receipt says that rows arrive, or none comes, ask again and again.
        """
        asked: set[str] = set()
        asked_at = time.monotonic()
        connection = self._connector.reconnects
        while True:
            await asyncio.sleep(_LOOK_S)
            if self._connector.reconnects != connection:
                connection, asked = self._connector.reconnects, set()
            doubtful = self._config.spool.until == "acknowledged" or self._delivery.receipt_lag_s > _LATE_S
            if doubtful and time.monotonic() - asked_at > _AGAIN_S:
                asked = set()
            examples = self._delivery.examples
            if self._connector.state != "connected" or set(examples) <= asked:
                continue
            if not asked:
                self._delivery.ask()
            some = sorted(set(examples) - asked)[:_AT_ONCE]
            asked_at = time.monotonic()
            found = await self._refusals(some)
            before, self._refused = self._refused, found or {}
            if self._refused:
                self._delivery.doubt()
                asked = set()
                self._says.trouble("broker", "refuses", self.trouble, logging.ERROR)
                await asyncio.sleep(_REFUSED_S)
                continue
            asked |= set(some)
            if before:
                self._says.fine("broker", "takes rows again")
                self._delivery.again()
            elif set(examples) <= asked:
                self._delivery.trust()

    async def ask_at_last(self) -> None:
        """What the broker has acknowledged is delivered if it takes rows now: a stop leaves nothing to send again."""
        some = sorted(self._delivery.examples)
        if self._refused or not some or self._connector.state != "connected":
            return
        self._delivery.ask()
        if not await self._refusals(some):
            self._delivery.trust()

    async def _refusals(self, some: Sequence[str]) -> dict[str, str] | None:
        """Of these topics those whose rows the broker refuses; None: it does not say."""
        messages = [replace(self._delivery.examples[topic], tag=None) for topic in some]
        return await refused(self._config.mqtt.address(), self._client_id, self._config.device, messages)
