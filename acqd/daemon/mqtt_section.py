"""The section [mqtt] of acqd.toml: the broker, its password and its certificates."""

from __future__ import annotations

import contextlib
import logging
import os
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from acqd.daemon.section import BrokerName, Host, Port
from acqd.errors import UserError
from acqd.section import FileName, Section
from acqd.telemetry.mqtt import BrokerAddress

_log = logging.getLogger(__name__)
Service = Literal["daemon", "sink", "sidecar", "web", "bridge", "operator"]
"""Who logs in at the broker: the daemon with the user of [mqtt], everybody else with a user of [mqtt] or the same."""
USERS: tuple[Service, ...] = ("sink", "sidecar", "web", "bridge", "operator")
"""Keys of [mqtt] that are users."""
_CREDENTIALS = "$CREDENTIALS_DIRECTORY"
"""Folder of systemd's LoadCredential, at the beginning of a path."""


class BrokerUser(Section):
    """The user of one service at the broker, where the broker knows the service by another name than the daemon."""

    username: BrokerName
    password: str | None = Field(default=None, repr=False)
    password_file: FileName | None = None
    cert_file: FileName | None = None
    key_file: FileName | None = None

    @model_validator(mode="after")
    def _not_contradictory(self) -> BrokerUser:
        _one_password(self)
        if (self.cert_file is None) != (self.key_file is None):
            raise ValueError("a client certificate needs cert_file and key_file")
        return self


class MqttSection(Section):
    """The broker, for the daemon, the sink and the viewers."""

    enabled: bool = True
    host: Host = "127.0.0.1"
    port: Port = 1883
    username: BrokerName | None = None
    password: str | None = Field(default=None, repr=False)
    password_file: FileName | None = None
    tls: bool | None = None
    """None: with TLS if any certificate is named."""
    rows: Literal["channel", "window"] = "channel"
    """A message for each channel's row, or one for all rows of a window."""
    ca_file: FileName | None = None
    cert_file: FileName | None = None
    key_file: FileName | None = None
    sink: BrokerUser | None = None
    sidecar: BrokerUser | None = None
    web: BrokerUser | None = None
    """Also of `acqd watch`."""
    bridge: BrokerUser | None = None
    """Of all bridges, the OPC UA server and the alarms."""
    operator: BrokerUser | None = None
    """Of a person who acknowledges alarms."""
    queue: Annotated[int, Field(ge=100, le=10_000_000)] | None = None
    """Without effect since rows wait in the spool; kept so that older files are still read."""

    @model_validator(mode="after")
    def _not_contradictory(self) -> MqttSection:
        named = [name for name in ("ca_file", "cert_file", "key_file") if getattr(self, name) is not None]
        if self.tls is False and named:
            raise ValueError(f"tls is false, but {named[0]} is set: delete one of the two")
        if self.key_file is not None and self.cert_file is None:
            raise ValueError("key_file is set without cert_file: a client certificate needs both")
        _one_password(self)
        own = self.password is not None or (self.password_file is not None and not in_credentials(self.password_file))
        for service, user in self.users.items():
            if own and user.password is None and user.password_file is None and user.username != self.username:
                raise ValueError(
                    f"{service}.username is set without {service}.password_file; the password of [mqtt] is another's: "
                    f"give {service} a password_file, or delete its username"
                )
        return self

    @property
    def users(self) -> dict[Service, BrokerUser]:
        """Services that have a user besides the daemon's."""
        return {name: user for name in USERS if (user := getattr(self, name)) is not None}

    @property
    def without_password(self) -> list[Service]:
        """Services whose password systemd would pass, outside of a unit and without its file: they are not here."""
        if _CREDENTIALS[1:] in os.environ:
            return []
        files = {name: self.of(name).password_file for name in self.users}
        return [name for name, path in files.items() if path is not None and in_credentials(path)]

    def of(self, service: Service) -> MqttSection:
        """The section as one service uses it: with the service's user, password and client certificate."""
        user = self.users.get(service)
        if user is None:
            return self
        changed = user.model_dump(exclude_none=True)
        if user.password is not None or user.password_file is not None:
            changed = dict.fromkeys(("password", "password_file")) | changed
        return self.model_copy(update=changed)

    @property
    def uses_tls(self) -> bool:
        """Whether the connection is encrypted: as `tls` says, or because a certificate is named."""
        return bool(self.tls or self.ca_file or self.cert_file)

    @property
    def certificates(self) -> list[Path]:
        """Files of certificates that this connection needs, as far as they have a place."""
        found = []
        for name in ("ca_file", "cert_file"):
            with contextlib.suppress(UserError):
                if (path := _expanded(name, getattr(self, name))) is not None:
                    found.append(path)
        return found

    def address(self, *, warn: bool = True) -> BrokerAddress:
        """Where and how to connect; `warn`: of a password in clear text. Raises UserError for an unreadable file."""
        password = self.password if self.password_file is None else _secret(self.password_file, self.username)
        files = {name: _expanded(name, getattr(self, name)) for name in ("ca_file", "cert_file", "key_file")}
        address = BrokerAddress(self.host, self.port, self.username, password, self.uses_tls, **files)
        if warn and address.exposes_password:
            _log.warning("the password goes to %s in clear text; set tls = true in [mqtt]", self.host)
        return address


def in_credentials(path: Path) -> bool:
    """Whether systemd passes the file to its unit."""
    return path.parts[:1] == (_CREDENTIALS,)


def _one_password(section: MqttSection | BrokerUser) -> None:
    if section.password is not None and section.password_file is not None:
        raise ValueError("password and password_file are set: delete one of the two")


def _expanded(key: str, path: Path | None, file: str = "") -> Path | None:
    """A path below $CREDENTIALS_DIRECTORY as a real one. Raises UserError without that folder.

    `file`: what root reads instead beside an installed configuration.
    """
    if path is None or not in_credentials(path):
        return path
    folder = os.environ.get(_CREDENTIALS[1:])
    if folder is None:
        raise UserError(
            f"mqtt.{key}: no credentials here: systemd passes them to services (LoadCredential=), by hand root reads "
            f"/etc/acqd/{file or path.name}; acqd service install makes it, --with SERVICE that of a further service"
        )
    return Path(folder, *path.parts[1:])


def _secret(path: Path, user: str | None) -> str:
    """The first line of a password file. Its path is not repeated: it may be a password in the wrong place."""
    hint = "expected the path of a file that holds nothing but the password"
    try:
        lines = (_expanded("password_file", path, f"{user}.password") or path).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise UserError(f"the password file (mqtt.password_file) cannot be read ({error.strerror}); {hint}") from None
    except ValueError:
        raise UserError(f"the password file (mqtt.password_file) is no UTF-8 text; {hint}") from None
    if not lines or not lines[0].strip() or len(lines) > 1:
        raise UserError(f"the password file (mqtt.password_file) has {len(lines)} lines; {hint}, in one line")
    return lines[0].strip()
