"""Private mosquitto and PostgreSQL servers for the measurements: free port, temporary folder."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from acqd.telemetry.broker import free_port

_QUIET: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def _wait(port: int) -> None:
    """Wait until a server listens on `port`. Raises RuntimeError after 20 s."""
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise RuntimeError(f"nothing listens on port {port}")


@contextmanager
def mosquitto() -> Iterator[int]:
    """Run a broker as config/mosquitto.conf configures it; yields its port."""
    port = free_port()
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "m.conf"
        config.write_text(
            f"listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n"
            "max_queued_messages 1000000\nmax_inflight_messages 0\n"
        )
        program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin") or "mosquitto"
        process = subprocess.Popen([program, "-c", config], **_QUIET)
        try:
            _wait(port)
            yield port
        finally:
            process.terminate()
            process.wait()


@contextmanager
def postgres() -> Iterator[str]:
    """Run a server with its default durability; yields the URL of an empty database."""
    programs = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda p: float(p.parent.name))[-1]
    port = free_port()
    user: dict[str, Any] = {"user": "postgres", "cwd": "/"} if os.geteuid() == 0 else {}
    with tempfile.TemporaryDirectory() as folder:
        if user:
            shutil.chown(folder, "postgres")
        data = Path(folder) / "data"
        subprocess.run([programs / "initdb", "-D", data, "-A", "trust", "-U", "acqd"], check=True, **_QUIET, **user)
        options = ["-p", str(port), "-k", folder, "-c", "listen_addresses=127.0.0.1"]
        process = subprocess.Popen([programs / "postgres", "-D", data, *options], **_QUIET, **user)
        try:
            _wait(port)
            time.sleep(1.0)  # the server listens before it is ready
            yield f"postgresql://acqd@127.0.0.1:{port}/postgres"
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()
