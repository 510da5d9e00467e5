"""The checks of `acqd doctor` on the configured source: libraries, interface, permissions, reachability."""

from __future__ import annotations

import importlib.util
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from acqd.daemon.finding import Finding
from acqd.daemon.modbus_sections import MetersSection, ModbusSection
from acqd.daemon.privilege_checks import NET_ADMIN, NET_RAW, raw_network_access
from acqd.daemon.source_sections import (
    AdsSection,
    EthercatSection,
    ReplaySection,
    SampledValuesSection,
    SourceSection,
)

_LIBRARIES = {
    "ethercat": ["pysoem"],
    "ads": ["pyads"],
    "modbus": ["pymodbus", "serial"],
    "meters": ["pymodbus", "serial"],
}
_ADS_PORT = 48_898
_UP = 1  # IFF_UP


def source_checks(source: SourceSection) -> Iterator[Finding]:
    """Findings about the configured source, in reading order. A device is asked for a TCP connection at most."""
    yield from _libraries(source.kind)
    if isinstance(source, EthercatSection | SampledValuesSection):
        needed = [NET_RAW] if isinstance(source, SampledValuesSection) else [NET_RAW, NET_ADMIN]
        yield _interface(source.interface)
        yield raw_network_access(needed)
    elif isinstance(source, AdsSection):
        yield _reachable("source", source.host, _ADS_PORT, "is the TwinCAT PC on, and its firewall open for 48898?")
    elif isinstance(source, ModbusSection | MetersSection):
        if source.host:
            yield _reachable("source", source.host, source.port, "check address, cable and power")
        else:
            yield _serial(Path(source.serial_port or ""))
    elif isinstance(source, ReplaySection):
        there = source.file.is_file()
        yield Finding("source", "ok" if there else "fail", f"{source.file}", "" if there else "no such file")


def _libraries(kind: str) -> Iterator[Finding]:
    missing = [name for name in _LIBRARIES.get(kind, []) if importlib.util.find_spec(name) is None]
    if missing:
        yield Finding("source libraries", "fail", f"{', '.join(missing)} not installed", "make install EXTRA=hw")


def _interface(name: str) -> Finding:
    names = sorted(existing for _, existing in socket.if_nameindex())
    if name not in names:
        return Finding("source interface", "fail", f"{name} does not exist", f"this host has {', '.join(names)}")
    state = Path(f"/sys/class/net/{name}")
    if state.exists():  # missing in a network namespace that shows the host's /sys
        if not int((state / "flags").read_text(), 16) & _UP:
            return Finding("source interface", "fail", f"{name} is down", f"ip link set {name} up")
        if (state / "carrier").read_text().strip() != "1":
            return Finding("source interface", "warn", f"{name} has no link", "check cable and power")
    return Finding("source interface", "ok", f"{name} is up")


def _reachable(check: str, host: str, port: int, advice: str) -> Finding:
    try:
        socket.create_connection((host, port), timeout=3).close()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        return Finding(check, "fail", f"{host}:{port} does not answer ({reason})", advice)
    return Finding(check, "ok", f"{host}:{port} answers")


def _serial(port: Path) -> Finding:
    if not port.exists():
        return Finding("source", "fail", f"{port} does not exist", "plug the adapter in, or see ls /dev/tty*")
    if not os.access(port, os.R_OK | os.W_OK):
        return Finding("source", "fail", f"{port} may not be opened by this user", "usermod -aG dialout acqd")
    return Finding("source", "ok", f"{port} can be opened")
