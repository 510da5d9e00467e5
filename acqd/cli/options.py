"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:  # most commands read no acqd.toml, and its models take a third of a second to build
    from acqd.daemon.config import Config
    from acqd.telemetry.mqtt import BrokerAddress

Json = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")]
ConfigFile = Annotated[Path | None, typer.Option("--config", "-c", help="acqd.toml to take settings from.")]
Host = Annotated[str | None, typer.Option(help="Broker host (default 127.0.0.1, or the config's).")]
Port = Annotated[int | None, typer.Option(min=1, max=65535, help="Broker port (default 1883, or the config's).")]


def configured(path: Path | None, host: str | None = None, port: int | None = None) -> Config:
    """The configuration file, or the defaults, with host and port of the command line."""
    from acqd.daemon.config import Config, load_config

    config = load_config(path) if path else Config()
    if host is not None:
        config.mqtt.host = host
    if port is not None:
        config.mqtt.port = port
    return config


def broker_address(path: Path | None, host: str | None, port: int | None) -> BrokerAddress:
    """How to reach the broker."""
    return configured(path, host, port).mqtt.address()
