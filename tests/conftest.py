"""Real servers on private ports, real recordings, and synthetic mains with a known truth."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: many small matrices, two cores

import json
import os
import shutil
import signal
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acqd.telemetry.broker import free_port
from tests.builders import acqd, grey, recording, write_dataset
from tests.discrepancy.independent import added_payload
from tests.waiting import wait_for

WAVEFORMS = Path(__file__).parents[1].parent / "shared" / "data" / "waveforms"


@pytest.fixture(scope="session")
def waveforms() -> Path:
    if not WAVEFORMS.is_dir():
        pytest.skip(f"no recordings at {WAVEFORMS} (a stranger's clone has none)")
    return WAVEFORMS


def _binary(name: str) -> str:
    found = shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/usr/local/sbin")
    assert found, f"{name} is missing: `make test` installs it"
    return found


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@dataclass
class Mosquitto:
    """A real broker that can be stopped and started again on the same port."""

    folder: Path
    port: int
    extra: str = "allow_anonymous true\n"
    process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        config = self.folder / "mosquitto.conf"
        config.write_text(
            f"listener {self.port} 127.0.0.1\n{self.extra}set_tcp_nodelay true\npersistence true\n"
            f"persistence_location {self.folder}/\nmax_queued_messages 1000000\nmax_inflight_messages 0\n"
            "user root\n"
        )
        self.process = subprocess.Popen([_binary("mosquitto"), "-c", config], stderr=subprocess.DEVNULL)
        wait_for(lambda: _listens(self.port), "mosquitto listens")

    def stop(self) -> None:
        if self.process is not None:
            self.process.terminate()
            self.process.wait(10)
            self.process = None


@pytest.fixture
def mosquitto(tmp_path: Path) -> Iterator[Mosquitto]:
    folder = tmp_path / "mosquitto"
    folder.mkdir()
    broker = Mosquitto(folder, free_port())
    broker.start()
    yield broker
    broker.stop()


def _postgres_bin() -> Path:
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda p: float(p.parent.name))
    return folders[-1] if folders else Path(_binary("initdb")).parent


@pytest.fixture(scope="session")
def postgres_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """URL prefix of a private PostgreSQL server; databases are made per test."""
    programs = _postgres_bin()
    folder = tmp_path_factory.mktemp("postgres")
    port = free_port()
    as_user: dict[str, object] = {}
    if os.geteuid() == 0:  # PostgreSQL refuses to run as root
        for parent in (folder, *folder.parents[:3]):
            parent.chmod(0o755)
        shutil.chown(folder, "postgres")
        as_user = {"user": "postgres", "cwd": "/"}
    data = folder / "data"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run(
        [programs / "initdb", "-D", data, "-A", "trust", "-U", "acqd", "-E", "UTF8", "--no-locale"],
        check=True, **quiet, **as_user,
    )  # fmt: skip
    options = ["-p", str(port), "-k", str(folder), "-c", "listen_addresses=127.0.0.1", "-c", "fsync=off"]
    server = subprocess.Popen([programs / "postgres", "-D", data, *options], **quiet, **as_user)
    ready = [programs / "pg_isready", "-h", "127.0.0.1", "-p", str(port)]
    wait_for(lambda: subprocess.run(ready, check=False, **quiet).returncode == 0, "PostgreSQL answers", 30)
    yield f"postgresql://acqd@127.0.0.1:{port}"
    server.send_signal(signal.SIGINT)  # fast shutdown: do not wait for pooled connections
    server.wait(20)


@pytest.fixture
def postgres(postgres_server: str, request: pytest.FixtureRequest) -> Iterator[str]:
    import psycopg

    name = f"t{abs(hash(request.node.nodeid)) % 10**9}"
    with psycopg.connect(f"{postgres_server}/postgres", autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    yield f"{postgres_server}/{name}"


@pytest.fixture(params=["sqlite", "postgres"])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Each database in turn."""
    if request.param == "postgres":
        return str(request.getfixturevalue("postgres"))
    return f"sqlite:///{tmp_path / 'test.sqlite'}"


EN50160 = {
    2: 0.02, 3: 0.05, 4: 0.01, 5: 0.06, 6: 0.005, 7: 0.05, 8: 0.005, 9: 0.015, 10: 0.005, 11: 0.035, 13: 0.03,
    15: 0.005, 17: 0.02, 19: 0.015, 21: 0.005, 23: 0.015, 25: 0.015,
}  # fmt: skip
"""EN 50160 limits, all at once: worse than any mains."""


@dataclass
class Mains:
    """Synthetic mains as codes, with the exact answers."""

    codes: np.ndarray
    scale: tuple[float, ...]
    rate: float
    Vrms: float
    Irms: float
    P: float


def make_mains(
    f: float,
    *,
    seconds: float = 4.0,
    rate: float = 20_000.0,
    phases: int = 3,
    harmonics: dict[int, float] | None = None,
    noise: float = 0.0,
    dc: float = 0.0,
    volts: float = 230.0,
    amperes: float = 3.0,
    lag: float = 0.5,
    seed: int = 0,
) -> Mains:
    """u with `harmonics`, DC and noise (shares of the fundamental), i a lagging sine with some H3."""
    random = np.random.default_rng(seed)
    harmonics = harmonics or {}
    count = int(seconds * rate)
    t = np.arange(count) / rate
    scale = (737.2575 / 32768, 9.207527 / 32768)
    codes = np.empty((count, 2 * phases), dtype=np.int16)
    angles = {h: random.uniform(0, 2 * np.pi) for h in {*harmonics, 3}}
    for phase in range(phases):
        angle = 2 * np.pi * f * t - 2 * np.pi * phase / 3 + 0.3
        u = np.cos(angle) + dc
        for h, share in harmonics.items():
            u = u + share * np.cos(h * angle + angles[h])
        i = np.cos(angle - lag) + 0.1 * np.cos(3 * (angle - lag))
        u = u + noise * random.standard_normal(count)
        codes[:, 2 * phase] = np.rint(u * volts * np.sqrt(2) / scale[0])
        codes[:, 2 * phase + 1] = np.rint(i * amperes * np.sqrt(2) / scale[1])
    # cos carries volts^2 of mean square; DC of `dc` amplitudes carries (dc * sqrt 2 * volts)^2.
    square = 1 + sum(share**2 for share in harmonics.values()) + 2 * dc**2
    third = harmonics.get(3, 0.0) * 0.1 * np.cos(angles[3] + 3 * lag)
    power = volts * amperes * (np.cos(lag) + third)
    return Mains(codes, scale * phases, rate, volts * np.sqrt(square), amperes * np.sqrt(1.01), float(power))


@pytest.fixture(scope="session")
def model():
    """A grey box with drives as a small robot has them."""
    return grey()


@pytest.fixture(scope="session")
def closed(model, tmp_path_factory):
    """A folder: a reference (before/ds), a model, recordings with a payload (now/ds) and the loop closed on them."""
    folder = tmp_path_factory.mktemp("loop")
    reference = write_dataset(folder / "before", [recording(model, k, seed=1, rows=900) for k in range(9)])
    in_question = [recording(model, k, added_payload, seed=2, rows=900, start_s=1e9 + 9000) for k in range(12)]
    now = write_dataset(folder / "now", in_question)
    done = acqd("train", reference, "--network", "grey-box", "--out", folder / "model")
    assert done.returncode == 0, done.stderr
    done = acqd("close-loop", now, "--model", folder / "model", "--json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)
