"""`acqd web`: the live page."""

from __future__ import annotations

from typing import Annotated

import orjson
import typer

from acqd.cli.options import ConfigFile, Json, configured
from acqd.extras import require
from acqd.telemetry.broker import check_port


def web(
    config: ConfigFile = None,
    listen: Annotated[str, typer.Option(help="Address to serve on; any but loopback needs the token.")] = "127.0.0.1",
    web_port: Annotated[int, typer.Option("--web-port", min=1, max=65535, help="Port to serve on.")] = 8731,
    host: Annotated[str | None, typer.Option(help="Broker host (default 127.0.0.1, or the config's).")] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Broker port (default 1883).")] = None,
    database: Annotated[str | None, typer.Option(help="SQL database of the past (default: the config's).")] = None,
    token: Annotated[str | None, typer.Option(help="Token to ask for (default off loopback: a new one).")] = None,
    json: Json = False,
) -> None:
    """Serve the live page: power, voltage, current and energy as numbers and charts, and the services' health.

    Example: acqd web --config acqd.toml
    """
    require("acqd web", ("starlette", "uvicorn"), "web")
    from acqd.web.server import Server
    from acqd.web.settings import WebSettings, token_for

    chosen = configured(config, host, port)
    check_port(listen, web_port)
    settings = WebSettings(
        chosen.mqtt.address(), database or chosen.sink.database, chosen.health, listen, web_port,
        token_for(listen, token),
    )  # fmt: skip
    print(orjson.dumps({"address": settings.address}).decode() if json else f"look at {settings.address}", flush=True)
    Server(settings).run()
