"""`acqd web`: the live page."""

from __future__ import annotations

import logging
import os
import sys
from typing import Annotated

import orjson
import typer

from acqd.cli.options import ConfigFile, Host, Json, Port, bare, configured
from acqd.daemon.config import Config
from acqd.daemon.web_section import WebSection
from acqd.extras import require
from acqd.plc.realtime import die_with_parent
from acqd.telemetry.ports import check_port

_log = logging.getLogger(__name__)


def web(
    config: ConfigFile = None,
    listen: Annotated[
        str | None,
        typer.Option(callback=bare, help="Address to serve on (default 127.0.0.1); any but loopback needs the token."),
    ] = None,
    web_port: Annotated[
        int | None, typer.Option("--web-port", min=1, max=65535, help="Port to serve on (default 8731).")
    ] = None,
    host: Host = None,
    port: Port = None,
    database: Annotated[str | None, typer.Option(help="SQL database of the past (default: the config's).")] = None,
    token: Annotated[str | None, typer.Option(help="Token to ask for (default off loopback: a new one).")] = None,
    embedded: Annotated[int | None, typer.Option("--embedded", hidden=True, help="Process id of its daemon.")] = None,
    json: Json = False,
) -> None:
    """Serve the live page: numbers, charts, waveforms, predictions and the services' health.

    Example: acqd web --config acqd.toml
    """
    require("acqd web", ("starlette", "uvicorn"), "web")
    from acqd.web.server import Server
    from acqd.web.settings import settings_of

    if embedded:
        die_with_parent(embedded)
    # `acqd run` hands its configuration over on stdin, as to the sink
    chosen = Config.model_validate_json(sys.stdin.read()) if embedded else configured(config, host, port, "web")
    given = {"host": listen, "port": web_port, "token": token}
    section = chosen.web.model_copy(update={name: value for name, value in given.items() if value is not None})
    if embedded and "NOTIFY_SOCKET" in os.environ:
        section = without_work(section)
    check_port(section.host, section.port, "page", "--web-port or [web] port")
    settings = settings_of(chosen, database or chosen.sink.database, section)
    server = Server(settings)
    if embedded:
        print("ready", flush=True)
        _log.info("look at %s", settings.address)
    else:
        if port is not None and web_port is None:
            print(f"acqd: --port {port} is that of the broker; --web-port is that of the page", file=sys.stderr)
        address = orjson.dumps({"address": settings.address}).decode()
        print(address if json else f"look at {settings.address}", flush=True)
    server.run()


def without_work(section: WebSection) -> WebSection:
    """A page within acqd.service, which has memory for metering only: a search would end the metering."""
    if section.files or section.loop:
        _log.warning(
            "[web] files and loop are off within acqd.service; set enabled = false there, and "
            "systemctl enable --now acqd-web"
        )
    return section.model_copy(update={"files": False, "loop": False})
