"""`acqd opcua`: the rows as variables of an OPC UA server."""

from __future__ import annotations

import asyncio
import logging
import socket

import orjson

from acqd.cli.options import ConfigFile, Host, Json, Port, configured
from acqd.extras import require
from acqd.telemetry.ports import check_port


def opcua(config: ConfigFile = None, host: Host = None, port: Port = None, json: Json = False) -> None:
    """Serve rows as OPC UA variables with units, source timestamps and quality; see section opcua of acqd.toml.

    Example: acqd opcua --config /etc/acqd/acqd.toml
    """
    require("acqd opcua", ("asyncua",), "opcua")
    from acqd.integrations.bridge import Relay
    from acqd.integrations.opcua.section import OpcUaSection
    from acqd.integrations.opcua.server import OpcUaServer
    from acqd.integrations.service import until_stopped

    # it warns of every client without encryption, and logs what we say better
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    settings = configured(config, host, port, "bridge")
    section = settings.table(OpcUaSection)
    server = OpcUaServer(section)
    relay = Relay(settings.mqtt.address(), server, f"acqd-opcua-{socket.gethostname()}")

    async def both(stop: asyncio.Event) -> None:
        serving = asyncio.ensure_future(server.serve(stop))
        relaying = asyncio.ensure_future(relay.run(stop))
        await asyncio.wait({serving, relaying}, return_when=asyncio.FIRST_COMPLETED)
        stop.set()
        await asyncio.gather(serving, relaying)

    check_port(section.host, section.port, "OPC UA", "[opcua] port")
    print(orjson.dumps({"endpoint": server.endpoint}).decode() if json else f"serving {server.endpoint}", flush=True)
    asyncio.run(until_stopped(both))
