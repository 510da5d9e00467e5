"""`acqd bridge`: rows in the form of other programs, on the same broker."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import orjson
import typer

from acqd.cli.options import ConfigFile, Host, Json, Port, configured
from acqd.errors import UserError

if TYPE_CHECKING:
    from sqlalchemy import Engine

    from acqd.daemon.config import Config
    from acqd.energy.running import Running

app = typer.Typer(no_args_is_help=True, help="Rows in the form of other programs, on the same broker.")
_RETAINED_S = 2.0
"""A broker sends at once what it has retained; this is ample [s]."""


@app.command("homeassistant")
def homeassistant(
    config: ConfigFile = None,
    host: Host = None,
    port: Port = None,
    once: Annotated[bool, typer.Option("--once", help="End when the retained summaries are announced.")] = False,
    remove: Annotated[
        bool, typer.Option("--remove", help="Take acqd's entities out of Home Assistant, and end.")
    ] = False,
    device: Annotated[str | None, typer.Option(help="With --remove: only this device.")] = None,
    json: Json = False,
) -> None:
    """Announce every channel's quantities to Home Assistant (MQTT discovery), and devices that come later.

    Example: acqd bridge homeassistant --config /etc/acqd/acqd.toml
    """
    from acqd.integrations.homeassistant.discovery import Discovery
    from acqd.integrations.homeassistant.removal import Removal
    from acqd.integrations.homeassistant.section import HomeAssistantSection
    from acqd.integrations.service import serve

    if once and remove:
        raise UserError("bridge homeassistant: --once announces entities, and --remove takes them out: give one")
    if device is not None and not remove:
        raise UserError("bridge homeassistant: --device is for --remove; give that too, or leave it out")
    settings = configured(config, host, port, "bridge")
    section, address = settings.table(HomeAssistantSection), settings.mqtt.address()
    name = f"acqd-homeassistant-{socket.gethostname()}"
    if remove:
        removal = Removal(section.prefix, device)
        serve(address, removal, f"{name}-remove", _RETAINED_S)
        count, what = removal.removed, "removed"
    else:
        with _energies(settings, once=once) as energies:
            discovery = Discovery(section.prefix, section.expire_s, section.channels, energies)
            serve(address, discovery, name, _RETAINED_S if once else None)
        count, what = discovery.announced, "announced"
    print(orjson.dumps({what: count}).decode() if json else f"{count} entities {what}")


@contextmanager
def _energies(settings: Config, *, once: bool) -> Iterator[Callable[[], list[Running] | None]]:
    """What is known of the energy of all devices, once a minute; nothing without a tariff. Raises UserError."""
    if settings.energy.tariff is None:
        yield lambda: None
        return
    from acqd.energy.read import devices
    from acqd.energy.rules import rules_of
    from acqd.energy.running import RunningEnergy
    from acqd.integrations.regularly import Regularly

    running = RunningEnergy(rules_of(settings.energy))

    def read(engine: Engine) -> list[Running]:
        return [running.of(engine, name) for name in devices(engine)]

    reader = Regularly(settings.sink.database, read, 60.0)
    if once:
        reader.once()
        yield reader.newest
        return
    with reader:
        yield reader.newest


@app.command("influx")
def influx(config: ConfigFile = None, host: Host = None, port: Port = None, json: Json = False) -> None:
    """Write rows to InfluxDB (line protocol over HTTP); see section influx of acqd.toml.

    Example: acqd bridge influx --config /etc/acqd/acqd.toml
    """
    from acqd.integrations.influx import Influx, check_url
    from acqd.integrations.influx_section import InfluxSection
    from acqd.integrations.service import serve

    settings = configured(config, host, port, "bridge")
    section = settings.table(InfluxSection)
    check_url(section.url)
    with Influx(section.url, section.token, section.measurement, section.waiting, section.quality) as bridge:
        serve(settings.mqtt.address(), bridge, f"acqd-influx-{socket.gethostname()}")
    counts = {"written": bridge.written, "dropped": bridge.dropped, "refused": bridge.refused}
    print(
        orjson.dumps(counts).decode() if json else ", ".join(f"{value} rows {name}" for name, value in counts.items())
    )


@app.command("plain")
def plain(config: ConfigFile = None, host: Host = None, port: Port = None, json: Json = False) -> None:
    """Publish every quantity as a single number, acqd/DEVICE/CHANNEL/P; see section plain of acqd.toml.

    Example: acqd bridge plain --config /etc/acqd/acqd.toml
    """
    from acqd.integrations.plain import Plain
    from acqd.integrations.plain_section import PlainSection
    from acqd.integrations.service import serve

    settings = configured(config, host, port, "bridge")
    section = settings.table(PlainSection)
    bridge = Plain(section.prefix, every_row=section.every_row, quality=section.quality)
    _show(serve(settings.mqtt.address(), bridge, f"acqd-plain-{socket.gethostname()}"), json=json)


@app.command("sparkplug")
def sparkplug(config: ConfigFile = None, host: Host = None, port: Port = None, json: Json = False) -> None:
    """Publish 1 s summaries and power quality as an edge node of Sparkplug B; see section sparkplug of acqd.toml.

    Example: acqd bridge sparkplug --config /etc/acqd/acqd.toml
    """
    from acqd.integrations.service import serve
    from acqd.integrations.sparkplug.node import Node
    from acqd.integrations.sparkplug.section import SparkplugSection

    settings = configured(config, host, port, "bridge")
    section = settings.table(SparkplugSection)
    node = Node(section.group, section.node, section.stale_s, quality=section.quality)
    _show(serve(settings.mqtt.address(), node, f"acqd-sparkplug-{section.group}-{section.node}", qos=0), json=json)


@app.command("marks")
def marks(config: ConfigFile = None, host: Host = None, port: Port = None, json: Json = False) -> None:
    """Write down which part, program, step or state topics of a production system name, for `acqd energy --by part`.

    Topics and file are in section marks of acqd.toml.

    Example: acqd bridge marks --config /etc/acqd/acqd.toml
    """
    from acqd.errors import UserError
    from acqd.integrations.marks.file import MarksFile
    from acqd.integrations.marks.section import MarksSection
    from acqd.integrations.marks.writer import MarksWriter
    from acqd.integrations.service import serve

    settings = configured(config, host, port, "bridge")
    section = settings.table(MarksSection)
    if section.file is None or not section.topics:
        raise UserError("[marks] of acqd.toml needs file and topics (docs/energy.md)")
    file = MarksFile(section.file, time.time_ns())
    writer = MarksWriter(section, file)
    try:
        serve(settings.mqtt.address(), writer, f"acqd-marks-{socket.gethostname()}")
    finally:
        writer.close()
    counts = {"written": file.lines, "refused": writer.refused}
    print(orjson.dumps(counts).decode() if json else f"{file.lines} marks written, {writer.refused} messages refused")


def _show(sent: int, *, json: bool) -> None:
    print(orjson.dumps({"sent": sent}).decode() if json else f"{sent} messages sent")
