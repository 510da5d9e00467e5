"""The embedded broker: amqtt in this process, for trying things out and small cells.

MQTT 3.1.1, loopback by default, no passwords: a plant runs mosquitto. See
`docs/adr/0004`.
"""

from __future__ import annotations

import asyncio
import logging
import socket
from typing import Any

from amqtt.broker import Broker

from acqd.errors import UserError

_log = logging.getLogger(__name__)


class EmbeddedBroker:
    """An anonymous broker on one TCP port."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port
        # amqtt logs every packet it does not like; one process, one voice.
        for name in ("amqtt", "transitions"):
            logging.getLogger(name).setLevel(logging.ERROR)
        self._broker: Broker | None = None

    async def start(self) -> None:
        """Listen. Raises UserError when the port is taken or not allowed."""
        check_port(self.host, self.port)
        asyncio.get_running_loop().set_exception_handler(_quiet_strangers)
        self._broker = Broker(
            {
                "listeners": {"default": {"type": "tcp", "bind": f"{self.host}:{self.port}"}},
                "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
            }
        )
        await self._broker.start()
        _log.info("embedded broker listens on %s:%d", self.host, self.port)

    async def stop(self) -> None:
        """Disconnect everybody, at most a second."""
        if self._broker is not None:
            try:
                await asyncio.wait_for(self._broker.shutdown(), 1.0)
            except TimeoutError:
                _log.debug("embedded broker was slow to stop")


def _quiet_strangers(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """No traceback for a client that hangs up in the middle of its CONNECT."""
    error = context.get("exception")
    if isinstance(error, (OSError, asyncio.CancelledError)):
        _log.debug("embedded broker: %s", context["message"])
    else:
        loop.default_exception_handler(context)


def check_port(host: str, port: int) -> None:
    """Raise UserError unless this process may listen on host:port."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UserError(
                f"broker port {host}:{port} cannot be used ({error.strerror}): is another broker running there? "
                "Use that one, or choose another port"
            ) from None


def free_port(host: str = "127.0.0.1") -> int:
    """A port nobody listens on right now."""
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])
