"""What the live page needs to know."""

from __future__ import annotations

import ipaddress
import secrets
from dataclasses import dataclass, field
from pathlib import Path

from acqd.daemon.config import Config
from acqd.daemon.energy_section import EnergySection
from acqd.daemon.health.section import HealthSection
from acqd.daemon.web_section import WebSection
from acqd.telemetry.mqtt import BrokerAddress


@dataclass(frozen=True, slots=True)
class WebSettings:
    """Broker, database, health endpoints, and who may look."""

    broker: BrokerAddress
    database: str
    """Path of a SQLite file, or URL."""
    health: HealthSection
    host: str = "127.0.0.1"
    port: int = 8731
    token: str | None = None
    """Asked for in the address; None: nobody is asked."""
    section: WebSection = field(default_factory=WebSection)
    """Robot, folders and the loop."""
    energy: EnergySection = field(default_factory=EnergySection)
    """Tariff and zone."""
    proxy_secret: str = field(default="", repr=False)
    """What the proxy of [web.proxy] sends; without such a proxy ""."""
    archive: Path | None = None
    """Where the daemon keeps samples; None: nowhere."""

    @property
    def address(self) -> str:
        """What to type into a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/{f'?token={self.token}' if self.token else ''}"


def settings_of(config: Config, database: str, section: WebSection) -> WebSettings:
    """The settings of [web], as the command line may have changed it. Raises UserError."""
    secret = section.proxy.secret() if section.proxy is not None else ""
    token = None if secret else token_for(section.host, section.token or None)
    archive = config.archive.place(config.state_dir, config.device) if config.archived else None
    return WebSettings(
        config.mqtt.address(), database, config.health, section.host, section.port, token, section, config.energy,
        secret, archive,
    )  # fmt: skip


def token_for(host: str, given: str | None) -> str | None:
    """None on loopback unless one is given; elsewhere the given one, or a new one."""
    if given:
        return given
    try:
        loopback = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        loopback = False
    return None if loopback else secrets.token_urlsafe(18)
