"""`acqd sidecar`: predictions for a running cell."""

from __future__ import annotations

import asyncio
import logging
import signal
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer

from acqd.cli.options import ConfigFile, Host, Json, Port, configured
from acqd.daemon.notify import notify
from acqd.errors import UserError
from acqd.extras import require


def sidecar(
    logs: Annotated[Path, typer.Argument(metavar="LOGS", help="Folder where the robot's logs arrive.")],
    model: Annotated[Path, typer.Option(help="Bundle written by acqd train or close-loop.")],
    config: ConfigFile = None,
    database: Annotated[str | None, typer.Option(help="SQLite file or URL of the power rows.")] = None,
    host: Host = None,
    port: Port = None,
    device: Annotated[
        str | None, typer.Option(help="Meter of this robot (default: the only one in the database).")
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Also predict from acqd/DEVICE/joints, row by row.")] = False,
    no_mqtt: Annotated[bool, typer.Option("--no-mqtt", help="Store only, publish nothing.")] = False,
    patience: Annotated[float, typer.Option(min=0, help="How many seconds the last power rows may be late.")] = 10.0,
    retry_refused: Annotated[bool, typer.Option("--retry-refused", help="Try refused logs again.")] = False,
    until_idle: Annotated[
        bool, typer.Option("--until-idle", help="Stop when every log is done and published.")
    ] = False,
    json: Json = False,
) -> None:
    """Align arriving robot logs with metered power, predict, store, publish, and raise the drift alarm.

    Example: acqd sidecar /srv/robot-logs --model ds.models/grey-box-everything-s1 --config /etc/acqd/acqd.toml
    """
    require("acqd sidecar", ("safetensors", "scipy", "watchfiles"), "sidecar")
    if live and no_mqtt:
        raise UserError("--live answers over MQTT; leave out --no-mqtt")
    from acqd.sidecar.lock import exclusive
    from acqd.sidecar.opening import opened
    from acqd.sidecar.power_rows import device_of
    from acqd.sidecar.service import Sidecar
    from acqd.sidecar.settings import Settings
    from acqd.sidecar.store import Store
    from acqd.sidecar.worker import Worker
    from acqd.storage.database import open_database

    settings = configured(config, host, port, "sidecar")
    url = database or settings.sink.database
    logging.getLogger("watchfiles").setLevel(logging.WARNING)  # it logs every change

    def report(message: dict[str, Any]) -> None:
        if json:
            print(orjson.dumps(message).decode(), flush=True)

    def alive() -> None:
        notify("WATCHDOG=1")

    async def run() -> Sidecar | None:
        stop = asyncio.Event()
        for number in (signal.SIGTERM, signal.SIGINT):
            asyncio.get_running_loop().add_signal_handler(number, stop.set)
        notify("READY=1")
        engine = open_database(url, create=False) if until_idle else await opened(url, stop, alive)
        if engine is None:
            return None
        name = device_of(engine, device, settings.device)
        worker = Worker(Settings(model, url, name, None, patience), engine)
        for note in worker.notes:
            logging.getLogger(__name__).warning("%s", note)
        broker = None if no_mqtt else settings.mqtt.address()
        store = Store(engine, name)
        service = Sidecar(logs, worker, store, broker, name, live=live, retry_refused=retry_refused, report=report)
        with exclusive(engine):
            await service.run(stop, alive, until_idle=until_idle)
        return service

    service = asyncio.run(run())
    notify("STOPPING=1")
    done, refused, waiting = (service.done, service.refused, service.waiting) if service else (0, 0, 0)
    late = f", {waiting} wait for their power rows" if waiting else ""
    counts = orjson.dumps({"done": done, "refused": refused, "waiting": waiting}).decode()
    print(counts if json else f"{done} logs predicted, {refused} refused{late}")
