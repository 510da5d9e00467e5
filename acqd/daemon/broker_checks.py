"""The checks of `acqd doctor` on the broker: logs in as the services do, and reads the configuration of a local one."""

from __future__ import annotations

import secrets
import ssl
import time
from collections.abc import Iterator
from pathlib import Path

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.daemon.config import Config
from acqd.daemon.finding import Finding, State
from acqd.daemon.mosquitto_files import settings_of_local_broker
from acqd.errors import UserError
from acqd.telemetry import certificates
from acqd.telemetry.mqtt import BrokerAddress, is_loopback

_PATIENCE_S = 3.0
OPEN_TO_ALL = 0o007


def broker_checks(config: Config, away: State = "warn") -> Iterator[Finding]:
    """Whether the broker lets this configuration in, and what is dangerous or slow about it.

    `away`: how grave it is that the broker does not answer.
    """
    if not config.mqtt.enabled:
        yield Finding("broker", "warn", "mqtt.enabled is false", "no row is published")
        return
    yield from _secrets(config)
    yield from name_check(config)
    try:
        address = config.mqtt.address(warn=False)
        tls = address.tls_context()
    except UserError as error:
        yield Finding("broker", "fail", str(error), "see [mqtt] in the configuration")
        return
    if address.exposes_password:
        yield Finding("broker", "warn", f"the password goes to {address.host} in clear text", "set [mqtt] tls = true")
    if config.mqtt.certificates:
        why = certificates.trouble(config.mqtt.certificates)
        advice = "make another one (config/make-certificates.sh) and copy it to its place"
        yield Finding("certificates", "warn" if why else "ok", why or "none ends soon", advice if why else "")
    if address.tls and (why := _of_server(address)):
        yield Finding("certificates", "warn", why, "make another one on the broker's computer")
    try:
        yield _login(address, tls)
    except (OSError, ValueError) as error:
        if config.broker.embedded:
            yield Finding("broker", "ok", "embedded, not running now")
        else:
            why = f"{address} does not answer ({getattr(error, 'strerror', None) or error})"
            yield Finding("broker", away, why, "start it, or set [mqtt] host and port")
        return
    yield from _other_logins(config)
    if is_loopback(address.host) and not config.broker.embedded:
        yield from _delay()


def name_check(config: Config) -> Iterator[Finding]:
    """Whether the daemon's user is a device of this configuration, as the access rules that acqd brings demand.

    Where other services have users of their own (`sink` ... in [mqtt]), `username` is the daemon's.
    """
    user, devices = config.mqtt.username, config.devices
    if config.mqtt.enabled and config.mqtt.users and user not in (None, config.device, *devices):
        finding = (
            f"rows of {', '.join(devices)} go out as {user}: config/mosquitto.acl lets a user write its own name only"
        )
        yield Finding("broker user", "warn", finding, "write the device's name, or rules of your own")


def _secrets(config: Config) -> Iterator[Finding]:
    logins = {"mqtt": config.mqtt} | {f"mqtt.{name}": config.mqtt.of(name) for name in config.mqtt.users}
    for name, login in logins.items():
        for key in ("password_file", "key_file"):
            path: Path | None = getattr(login, key)
            if path is not None and path.is_file() and path.stat().st_mode & OPEN_TO_ALL:
                yield Finding("secrets", "warn", f"every user may open {name}.{key}", "chmod o= it, or LoadCredential")


def _other_logins(config: Config) -> Iterator[Finding]:
    """The other services of this computer, each with its user."""
    for service in config.mqtt.users:
        if service in config.mqtt.without_password:
            continue
        try:
            address = config.mqtt.of(service).address(warn=False)
            yield _login(address, address.tls_context())
        except (UserError, OSError, ValueError) as error:
            yield Finding("broker", "fail", f"mqtt.{service}: {error}", "see [mqtt] in the configuration")


def _login(address: BrokerAddress, tls: ssl.SSLContext | None) -> Finding:
    """One CONNECT with the real name and password, under another client identifier.

    Raises OSError or ValueError where nobody answers.
    """
    answers: list[str] = []
    client = paho.Client(CallbackAPIVersion.VERSION2, f"acqd-doctor-{secrets.token_hex(4)}", reconnect_on_failure=False)
    client.connect_timeout = _PATIENCE_S
    if address.username is not None:
        client.username_pw_set(address.username, address.password)
    if tls is not None:
        client.tls_set_context(tls)
    client.on_connect = lambda _c, _d, _f, reason, _p: answers.append(str(reason) if reason.is_failure else "")
    client.connect(address.host, address.port, keepalive=10)
    deadline = time.monotonic() + _PATIENCE_S
    while not answers and time.monotonic() < deadline and client.loop(0.1) == paho.MQTT_ERR_SUCCESS:
        pass
    client.disconnect()
    if not answers:
        return Finding(
            "broker", "fail", f"{address} hangs up or does not answer", "is a broker there? does it want TLS?"
        )
    if answers[0]:
        who = f" of {address.username}" if address.username else ""
        advice = "check username and password; has the broker read its password file since? Else delete "
        advice += "/etc/acqd/USER.password, and acqd service install makes another one"
        return Finding("broker", "fail", f"{address} refuses the login{who}: {answers[0]}", advice)
    name = f" as {address.username}" if address.username else ", without a password"
    return Finding("broker", "ok", f"{address} lets this configuration in{name}")


def _of_server(address: BrokerAddress) -> str:
    """What is wrong with the dates of the certificate that the broker shows; it may not answer."""
    try:
        pem = ssl.get_server_certificate((address.host, address.port), timeout=_PATIENCE_S)
        valid = certificates.validity(ssl.PEM_cert_to_DER_cert(pem))
    except (OSError, ValueError):
        return ""
    return certificates.near_end("of the broker", valid)


def _delay() -> Iterator[Finding]:
    """Nagle's algorithm: the broker waits for an acknowledgement before it sends the next small packet."""
    settings = settings_of_local_broker()
    if settings is not None and settings.get("set_tcp_nodelay") != "true":
        advice = "add the line to its configuration: a row takes 26 ms instead of 3 without it"
        yield Finding("broker delay", "warn", "mosquitto runs without set_tcp_nodelay true", advice)
