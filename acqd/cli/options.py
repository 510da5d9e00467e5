"""Options that several commands share."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acqd.cli.terminal import terminal
from acqd.errors import UserError

if TYPE_CHECKING:  # most commands read no acqd.toml, and its models take a third of a second to build
    from acqd.daemon.config import Config
    from acqd.daemon.mqtt_section import Service
    from acqd.telemetry.mqtt import BrokerAddress

Json = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")]
ConfigFile = Annotated[
    Path | None, typer.Option("--config", "-c", help="Default: ./acqd.toml, else /etc/acqd/acqd.toml.")
]


def bare(host: str | None) -> str | None:
    """Callback of options that name a computer: without scheme and port."""
    if host is None:
        return None
    from acqd.telemetry.ports import bare_host

    try:
        return bare_host(host)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


Host = Annotated[str | None, typer.Option(callback=bare, help="Broker host (default 127.0.0.1, or the config's).")]
Port = Annotated[int | None, typer.Option(min=1, max=65535, help="Broker port (default 1883, or the config's).")]


def utc_option(option: str, text: str | None) -> int | None:
    """A time as ns since 1970; without a zone: UTC. Raises UserError, which names `option`."""
    if text is None:
        return None
    try:
        stamp = datetime.fromisoformat(text)
    except ValueError:
        raise UserError(f"{option} {text!r}: expected a time like 2021-07-13T10:15:00Z") from None
    if not 1970 < stamp.year < 2200:
        raise UserError(f"{option} {text!r}: expected a time between 1971 and 2199")
    since = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)) - datetime(1970, 1, 1, tzinfo=UTC)
    return (since // timedelta(microseconds=1)) * 1000


def config_file(given: Path | None) -> Path | None:
    """The file that the command line names, else the one where a command looks; which one is said on stderr."""
    if given is not None:
        return given
    from acqd.daemon.config_place import found_config

    path, sentence = found_config()
    if sentence:
        terminal(stderr=True).print(f"acqd: {sentence}")
    return path


def configured(
    path: Path | None, host: str | None = None, port: int | None = None, service: Service = "daemon"
) -> Config:
    """The configuration file, or the defaults, with host and port of the command line and the user of `service`.

    A broker that the command line names gets no password of a file that it does not name.
    """
    from acqd.daemon.config import Config
    from acqd.daemon.config_file import load_config

    if host is None and port is None:
        path = config_file(path)
    config = load_config(path, service) if path else Config()
    if host is not None:
        config.mqtt.host = host
    if port is not None:
        config.mqtt.port = port
    return config


def broker_address(path: Path | None, host: str | None, port: int | None, service: Service = "daemon") -> BrokerAddress:
    """How to reach the broker."""
    return configured(path, host, port, service).mqtt.address()


def mean_price(tariff: Path | None) -> float | None:
    """EUR per kWh of a tariff's file, else of the configuration's; None without a tariff. Raises UserError."""
    from acqd.energy.rules import rules_of

    section = configured(None).energy
    chosen = section if tariff is None else section.model_copy(update={"tariff": tariff})
    rules = rules_of(chosen)
    return None if rules.tariff is None else rules.tariff.mean_price


Corners = tuple[float, float, float, float, float, float]


def box_of(corners: Corners | None) -> Corners | None:
    """Lower and upper corner of a workspace from two corners in any order, m. Raises UserError for a flat box."""
    if corners is None:
        return None
    first, second = corners[:3], corners[3:]
    if any(a == b for a, b in zip(first, second, strict=True)) or not all(map(isfinite, corners)):
        raise UserError("--workspace: two corners with different x, y and z, in m in the frame of the base")
    return (*map(min, first, second), *map(max, first, second))  # type: ignore[return-value]
