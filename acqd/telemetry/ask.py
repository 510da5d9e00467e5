"""Questions of a daemon, not retained: which rows of mine are stored last? Who else has my name?

Sinks answer the first one with a receipt that holds the last rows (`telemetry.receipts`), after everything that had
reached them before. Another daemon of the name answers the second one with its status.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

_Text = Annotated[str, Meta(max_length=128)]


class Claimant(msgspec.Struct, frozen=True):
    """A run of a daemon that claims a name."""

    instance: _Text = ""
    """Of the installation: the same after a restart."""
    boot: _Text = ""
    """Of this run."""
    host: _Text = ""
    since: _Text = ""
    """RFC 3339 UTC, by the clock of the host."""
    taken: bool = False
    """A person has told this daemon to take the name."""

    def __str__(self) -> str:
        return f"{self.host or 'unknown host'} (boot {self.boot or 'unknown'}, since {self.since or 'unknown'})"


class Ask(msgspec.Struct):
    """One message on the topic `ask` of a device."""

    ask: Literal["last_rows", "name"]
    boot: _Text = ""
    """last_rows: of this boot and its continuations."""
    who: Claimant | None = None
    """name: who asks."""
    schema: int = 1


_decoder = msgspec.json.Decoder(Ask)


def parse_ask(payload: bytes) -> Ask:
    """Raises ValueError."""
    try:
        return _decoder.decode(payload)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(str(error)) from None


def encode(ask: Ask) -> bytes:
    """The payload."""
    return msgspec.json.encode(ask)
