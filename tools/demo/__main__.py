"""Runs a protocol double and `acqd run`, which meters it over the real protocol.

    make run ARGS="--demo ethercat"

Every row is flagged as simulated.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from acqd.cli.main import for_people
from acqd.errors import UserError
from acqd.telemetry.broker import check_port, free_port
from tests.doubles.veth import may_create_veth, namespace_command
from tools.common.commands import acqd_command
from tools.demo.devices import DEVICES, ON_ETHERNET

_PORT = 1883
_INSIDE = "ACQD_DEMO_NAMESPACE"


def demo(
    kind: Annotated[str, typer.Option("--demo", help=f"One of {', '.join(DEVICES)}.")],
    duration: Annotated[float | None, typer.Option(min=0.1, help="Stop after so many seconds.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Meter a protocol double: real client, real wire, simulated device.

    Example: make run ARGS="--demo ethercat --duration 20"
    """
    if kind not in DEVICES:
        raise UserError(f"--demo {kind!r}: expected one of {', '.join(DEVICES)}")
    if kind in ON_ETHERNET and not may_create_veth():
        _enter_namespace(kind)
    with DEVICES[kind]() as source, tempfile.TemporaryDirectory(prefix="acqd-demo-") as folder:
        config = Path(folder) / "acqd.toml"
        config.write_text(_config(kind, source), encoding="utf-8")
        say = sys.stderr if json else sys.stdout
        print(
            f"a double of the device and acqd run with this configuration; stop with Ctrl-C\n{source}",
            file=say,
            flush=True,
        )
        options = ["--duration", duration] if duration else []
        options += ["--json"] if json else ["--lines"]
        raise SystemExit(_run(acqd_command("run", "--config", config, *options)))


def _run(command: list[str]) -> int:
    """Run the daemon and return its exit code. Ctrl-C reaches both processes; the daemon ends by itself."""
    process = subprocess.Popen(command)
    while True:
        try:
            return process.wait()
        except KeyboardInterrupt:
            continue


def _config(kind: str, source: str) -> str:
    try:
        check_port("127.0.0.1", _PORT)
        port = _PORT
    except UserError:
        port = free_port()
    volts = 5773.5 if kind == "sv" else 230.0
    return (
        f'device = "demo-{kind}"\n[mqtt]\nport = {port}\n[broker]\nembedded = true\n'
        f'[sink]\nembedded = true\ndatabase = "{Path.cwd() / "acqd.sqlite"}"\n'
        f"[metering]\nnominal_voltage = {volts}\n[source]\nsimulated = true\n{source}"
    )


def _enter_namespace(kind: str) -> None:
    """Run this program again in a namespace where it may create veth pairs. Raises UserError where none is allowed."""
    if (
        os.environ.get(_INSIDE)
        or subprocess.run(namespace_command(["true"]), check=False, capture_output=True).returncode
    ):
        raise UserError(
            f"--demo {kind} needs a pair of virtual network interfaces: run it as root, or allow user namespaces "
            "(sysctl kernel.unprivileged_userns_clone=1; Ubuntu: kernel.apparmor_restrict_unprivileged_userns=0)"
        )
    os.environ[_INSIDE] = "1"
    again = [sys.executable, "-m", "tools.demo", *sys.argv[1:]]
    # A new network namespace has its loopback interface down; broker and sink need it.
    command = namespace_command(["sh", "-c", 'ip link set lo up && exec "$@"', "sh", *again])
    os.execvp(command[0], command)


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(demo)
    for_people(app)
