"""Real servers on private ports, real recordings, and the products that many tests look at."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: many small matrices, two cores

import gc
import json
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from hypothesis import HealthCheck, settings

from acqd.telemetry.broker import free_port
from tests import slow
from tests.once import Once
from tests.places import WAVEFORMS
from tests.waiting import LIMIT_S, wait_for

settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")


gc.disable()  # what is imported and collected stays: to look for garbage in it takes an eighth of the time


def pytest_collection_finish() -> None:
    """From now on, only what tests make is looked at."""
    gc.enable()
    gc.freeze()


def pytest_configure(config: pytest.Config) -> None:
    """Slow tests run by what has changed."""
    choice = slow.Choice.of(config)
    config.stash[slow.CHOICE] = choice
    config.pluginmanager.register(choice)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """For `--dist loadgroup` with three workers or more."""
    from tests.schedule import OneWaits  # here, because pytest may run without xdist

    many = config.getoption("dist") == "loadgroup" and len(config.getoption("tx")) > 2
    return OneWaits(config, log) if many else None


def pytest_addoption(parser: pytest.Parser) -> None:
    """What `make test` and `make slow` ask for."""
    parser.addoption(
        "--slow",
        choices=("changed", "all", "none"),
        help="which slow tests run: of changed sources, which is then recorded, all, or none (the default without -m)",
    )


@pytest.hookimpl(tryfirst=True)  # before -m and -k: how many slow tests guard a part is counted here
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Slow tests that are not asked for leave; long tests come first, so that no worker ends alone with one."""
    config.stash[slow.CHOICE].apply(config, items)
    items.sort(key=lambda item: -_seconds(item))


def _seconds(item: pytest.Item) -> float:
    """What a test takes, roughly."""
    known = [mark.kwargs["seconds"] for mark in item.iter_markers("long")]
    return max([*known, 10 * len(list(item.iter_markers("slow")))])


@pytest.fixture(scope="session", autouse=True)
def coarse_pictures() -> Iterator[None]:
    """Reports of many tests hold pictures that nobody looks at: few pixels, no ticks, nothing laid out or trimmed.

    The commands that tests start as processes, and tests/report, make them as users get them.
    """
    from matplotlib.figure import Figure

    whole = Figure.savefig

    @wraps(whole)
    def coarse(figure: Figure, to: Any, **how: Any) -> None:
        figure.set_layout_engine("none")
        for axes in figure.axes:
            axes.set_axis_off()
            axes.set_title(axes.get_title(), y=1.0)  # where it is: no search for a place above all ticks
        whole(figure, to, **how | {"dpi": 20, "bbox_inches": None})

    @wraps(Figure.tight_layout)  # pyplot copies the method's name and documentation
    def as_it_is(figure: Figure, **_how: Any) -> None:
        return None

    with mock.patch.object(Figure, "savefig", coarse), mock.patch.object(Figure, "tight_layout", as_it_is):
        yield


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
        process, self.process = self.process, None
        if process is None:
            return

        def ended() -> bool:
            process.terminate()  # again: one that comes between listening and the main loop is lost on mosquitto
            return process.poll() is not None

        wait_for(ended, "mosquitto ends")


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
def postgres_server() -> Iterator[str]:
    """URL prefix of a private PostgreSQL server; databases are made per test.

    Its folder is not one of pytest's: another session that starts closes those to the user postgres.
    """
    with tempfile.TemporaryDirectory(prefix="acqd-postgres-", ignore_cleanup_errors=True) as folder:
        yield from _postgres_in(Path(folder))


def _postgres_in(folder: Path) -> Iterator[str]:
    programs = _postgres_bin()
    port = free_port()
    as_user: dict[str, object] = {}
    if os.geteuid() == 0:  # PostgreSQL refuses to run as root
        for parent in (folder, *folder.parents[:3]):  # the server must reach its folder; /tmp keeps its sticky bit
            parent.chmod(parent.stat().st_mode | 0o055)
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
    wait_for(lambda: subprocess.run(ready, check=False, **quiet).returncode == 0, "PostgreSQL answers")
    yield f"postgresql://acqd@127.0.0.1:{port}"
    server.send_signal(signal.SIGQUIT)  # immediate: no checkpoint of a folder that goes, no wait for connections
    server.wait(LIMIT_S)


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


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Once:
    """Makes a product that several tests look at, once for all workers of pytest-xdist."""
    base = tmp_path_factory.getbasetemp()
    return Once(base.parent if "PYTEST_XDIST_WORKER" in os.environ else base)


@pytest.fixture(scope="session")
def model():
    """A grey box with drives as a small robot has them."""
    from tests.builders import grey  # here, because it takes a second and not every test needs it

    return grey()


@pytest.fixture(scope="session")
def closed(model, once):
    """A folder: a reference (before/ds), a model, recordings with a payload (now/ds) and the loop closed on them."""
    from tests.builders import recording, write_dataset
    from tests.commands import acqd_here
    from tests.discrepancy.independent import added_payload

    def make(folder: Path) -> dict[str, Any]:
        reference = write_dataset(folder / "before", [recording(model, k, seed=1, rows=700) for k in range(9)])
        in_question = [recording(model, k, added_payload, seed=2, rows=700, start_s=1e9 + 9000) for k in range(9)]
        now = write_dataset(folder / "now", in_question)
        done = acqd_here("train", reference, "--network", "grey-box", "--out", folder / "model")
        assert done.returncode == 0, done.stderr
        done = acqd_here("close-loop", now, "--model", folder / "model", "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return once("closed", make)


@pytest.fixture(scope="session")
def bundle(once):
    """A bundle that remembers recordings to compare with."""
    from tests.sidecar.cell import write_bundle

    return once("bundle", lambda folder: write_bundle(folder / "bundle"))[0] / "bundle"


@pytest.fixture(scope="session")
def study(once):
    """The quick reproduction of the thesis as far as its models of Table 7.1: the study's own steps, in its places."""
    from rich.console import Console

    from tests.commands import module_here, without_workers
    from tools.studies.thesis import plan
    from tools.studies.thesis.assembly import Places
    from tools.studies.thesis.steps import run

    def make(folder: Path) -> None:
        places = Places(folder)
        steps = [
            *plan.training(places, plan.QUICK, 1),
            plan.table_7_1(places, plan.QUICK),
            plan.assembly(places, plan.QUICK, 1)[0],
        ]
        with without_workers(), mock.patch("tools.studies.thesis.steps.run_module", module_here):
            run(steps, folder, Console(quiet=True))

    return Places(once("study", make)[0])
