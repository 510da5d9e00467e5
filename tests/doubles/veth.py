"""Pair of virtual Ethernet interfaces, for protocols below IP."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex


class VethUnavailable(RuntimeError):  # noqa: N818 -- a state of the machine, not a defect
    """This process may not create veth pairs, or the kernel or iproute2 cannot."""


@contextmanager
def veth_pair(prefix: str = "acqd") -> Iterator[tuple[str, str]]:
    """Two connected interfaces with unique names, both up, without IPv6. Raises VethUnavailable."""
    stem = f"{prefix[:7]}{token_hex(3)}"
    names = f"{stem}a", f"{stem}b"
    _ip("link", "add", "name", names[0], "type", "veth", "peer", "name", names[1])
    try:
        for name in names:
            _disable_ipv6(name)
            _ip("link", "set", "dev", name, "up")
        yield names
    finally:
        # The pair is gone already where a test removed one end.
        with suppress(VethUnavailable):
            _ip("link", "delete", "dev", names[0])


def may_create_veth() -> bool:
    """Whether `veth_pair` works in this process."""
    try:
        with veth_pair("acqdtry"):
            return True
    except VethUnavailable:
        return False


def namespace_command(argv: Sequence[str]) -> list[str]:
    """`argv` in a user and network namespace of its own, where a caller that is not root may create veth pairs."""
    return ["unshare", "-Urn", *argv]


def _ip(*arguments: str) -> None:
    program = shutil.which("ip", path="/usr/sbin:/sbin:/usr/bin:/bin")
    if program is None:
        raise VethUnavailable("ip (iproute2) is missing")
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise VethUnavailable(f"ip {' '.join(arguments)}: {done.stderr.strip()}")


def _disable_ipv6(name: str) -> None:
    """Keep the kernel from sending router solicitations; where that file is missing there is no IPv6."""
    with suppress(OSError):
        Path(f"/proc/sys/net/ipv6/conf/{name}/disable_ipv6").write_text("1")
