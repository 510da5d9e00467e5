"""Network interfaces of this host."""

from __future__ import annotations

import socket

from acqd.errors import UserError

DROP_IN = "systemd/acqd-raw-network.conf"
"""What a unit with restricted address families and capabilities needs."""


def check_interface(interface: str, option: str = "source.interface") -> None:
    """Raise UserError, which names `option`, unless the interface exists."""
    # Not /sys/class/net: in a network namespace that shows the interfaces of the host.
    try:
        names = sorted(name for _, name in socket.if_nameindex())
    except OSError as error:
        raise UserError(f"{option}: {error.strerror}; the unit needs {DROP_IN} (docs/sources.md)") from None
    if interface not in names:
        raise UserError(f"{option}: there is no network interface {interface!r}; this host has {', '.join(names)}")
